// A loop over columns by hand, which the compiler turns into vectors of four (AVX2) with the
// functions of libmvec.
#include "../common.hpp"
#include <array>
#include <cstdint>
#include <cstring>

constexpr int LANES = 8;
constexpr double TAU = 6.283185307179586;

// xoshiro256+ in lanes.
struct Random {
    uint64_t s[4][LANES];
    explicit Random(uint64_t seed) {
        for (auto& row : s)
            for (auto& word : row) {
                uint64_t z = (seed += 0x9e3779b97f4a7c15);
                z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
                z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
                word = z ^ (z >> 31);
            }
    }
    // Numbers in (0, 1], as many as a multiple of the lanes.
    void fill(double* out, size_t count) {
        for (size_t at = 0; at < count; at += LANES) {
            uint64_t drawn[LANES];
            for (int i = 0; i < LANES; ++i) {
                uint64_t result = s[0][i] + s[3][i], t = s[1][i] << 17;
                s[2][i] ^= s[0][i], s[3][i] ^= s[1][i], s[1][i] ^= s[2][i], s[0][i] ^= s[3][i];
                s[2][i] ^= t, s[3][i] = (s[3][i] << 45) | (s[3][i] >> 19);
                drawn[i] = (result >> 12) | 0x3ff0000000000000;
            }
            double ones[LANES];
            std::memcpy(ones, drawn, sizeof ones);
            for (int i = 0; i < LANES; ++i) out[at + i] = 2.0 - ones[i];
        }
    }
};

struct Cloud {
    static constexpr size_t CHUNK = 512;
    const Bearings& problem;
    size_t count, padded;
    bool every_step;
    Random random;
    std::array<std::vector<double>, 4> columns, spare;
    std::vector<double> weights, marks;

    Cloud(const Bearings& problem, size_t count, uint64_t seed, bool every_step)
        : problem(problem), count(count), padded((count + CHUNK) / CHUNK * CHUNK),
          every_step(every_step), random(seed), weights(padded, 0.0), marks(padded) {
        std::fill_n(weights.begin(), count, 1.0 / double(count));
        double normal[4][CHUNK];
        for (int row = 0; row < 4; ++row) {
            columns[row].resize(padded);
            spare[row].resize(padded);
        }
        for (size_t from = 0; from < padded; from += CHUNK) {
            normals(normal);
            for (int row = 0; row < 4; ++row)
                for (size_t i = 0; i < CHUNK; ++i)
                    columns[row][from + i] =
                        problem.prior[row] + problem.spread[row] * normal[row][i];
        }
    }

    // Box and Muller.
    void normals(double (&out)[4][CHUNK]) {
        double uniform[4][CHUNK];
        random.fill(uniform[0], 4 * CHUNK);
        // Sine and cosine apart: together they are one function that has no vectors.
        for (int pair = 0; pair < 4; pair += 2) {
            const double *u = uniform[pair], *turn = uniform[pair + 1];
            double radius[CHUNK];
#pragma omp simd
            for (size_t i = 0; i < CHUNK; ++i) radius[i] = std::sqrt(-2.0 * std::log(u[i]));
#pragma omp simd
            for (size_t i = 0; i < CHUNK; ++i) out[pair][i] = radius[i] * std::cos(TAU * turn[i]);
#pragma omp simd
            for (size_t i = 0; i < CHUNK; ++i)
                out[pair + 1][i] = radius[i] * std::sin(TAU * turn[i]);
        }
    }

    void resample() {
        if (every_step) {
            random.fill(marks.data(), padded);
            double sum = 0.0;
#pragma omp simd
            for (size_t i = 0; i < padded; ++i) marks[i] = -std::log(marks[i]);
            for (size_t i = 0; i <= count; ++i) marks[i] = sum += marks[i];
            for (size_t i = 0; i < count; ++i) marks[i] /= sum;
        } else {
            double start[LANES];
            random.fill(start, LANES);
            for (size_t i = 0; i < count; ++i) marks[i] = (double(i) + start[0]) / double(count);
        }
        size_t at = 0;
        double reach = weights[0];
        for (size_t i = 0; i < count; ++i) {
            while (reach <= marks[i] && at + 1 < count) reach += weights[++at];
            for (int row = 0; row < 4; ++row) spare[row][i] = columns[row][at];
        }
        columns.swap(spare);
        std::fill_n(weights.begin(), count, 1.0 / double(count));
    }

    std::array<double, 4> step(const std::vector<double>& bearing) {
        double squares = 0.0;
#pragma omp simd reduction(+ : squares)
        for (size_t i = 0; i < count; ++i) squares += weights[i] * weights[i];
        if (every_step || 1.0 / squares < 0.5 * double(count)) resample();
        double *x = columns[0].data(), *y = columns[1].data(), *w = weights.data();
        double *vx = columns[2].data(), *vy = columns[3].data();
        double normal[4][CHUNK], total = 0.0;
        const double noise = problem.noise, share = problem.share / TAU, east = bearing[0];
        const double north = bearing[1], z = bearing[2] - problem.bias, sigma = problem.sigma;
        const double peak = (1.0 - problem.share) / (sigma * std::sqrt(TAU));
        for (size_t from = 0; from < padded; from += CHUNK) {
            normals(normal);
            // What lies behind the last has no weight.
#pragma omp simd reduction(+ : total)
            for (size_t i = 0; i < CHUNK; ++i) {
                size_t k = from + i;
                x[k] += vx[k] + noise * normal[0][i];
                y[k] += vy[k] + noise * normal[1][i];
                vx[k] += noise * normal[2][i];
                vy[k] += noise * normal[3][i];
                double off = z - std::atan2(y[k] - north, x[k] - east);
                off -= TAU * std::rint(off / TAU);
                off /= sigma;
                w[k] *= peak * std::exp(-0.5 * off * off) + share;
                total += w[k];
            }
        }
        double sums[4] = {}, products[10] = {};
        for (size_t from = 0; from < padded; from += CHUNK) {
            double s0 = 0, s1 = 0, s2 = 0, s3 = 0, p[10] = {};
#pragma omp simd reduction(+ : s0, s1, s2, s3, p[:10])
            for (size_t k = from; k < from + CHUNK; ++k) {
                w[k] /= total;
                double a = w[k] * x[k], b = w[k] * y[k], c = w[k] * vx[k], d = w[k] * vy[k];
                s0 += a, s1 += b, s2 += c, s3 += d;
                p[0] += a * x[k], p[1] += a * y[k], p[2] += a * vx[k], p[3] += a * vy[k];
                p[4] += b * y[k], p[5] += b * vx[k], p[6] += b * vy[k];
                p[7] += c * vx[k], p[8] += c * vy[k], p[9] += d * vy[k];
            }
            sums[0] += s0, sums[1] += s1, sums[2] += s2, sums[3] += s3;
            for (int i = 0; i < 10; ++i) products[i] += p[i];
        }
        kept = 0.0;
        for (int i = 0, entry = 0; i < 4; ++i)
            for (int j = i; j < 4; ++j) kept = kept + products[entry++] - sums[i] * sums[j];
        return {sums[0], sums[1], sums[2], sums[3]};
    }
    volatile double kept;
};

int main(int arguments_count, char** arguments) {
    if (arguments_count != 5) return 2;
    std::string name = arguments[1];
    Bearings problem(arguments[2]);
    long repeats = std::atol(arguments[3]);
    bool every_step = name == "multinomial";
    if (!every_step && name != "systematic") return 2;
    if (repeats > 0) {
        Cloud cloud(problem, std::atol(arguments[4]), 1, every_step);
        size_t next = 0;
        measured(repeats, double(cloud.count), [&] {
            cloud.step(problem.sequence[next]);
            next = (next + 1) % problem.sequence.size();
        });
        return 0;
    }
    std::printf("{\"means\": [");
    for (int seed = 1; seed <= SEEDS; ++seed) {
        Cloud cloud(problem, PARTICLES, seed, every_step);
        std::array<double, 4> mean{};
        for (int step = 0; step < STEPS; ++step) mean = cloud.step(problem.sequence[step]);
        std::printf("%s[%.17g, %.17g, %.17g, %.17g]", seed == 1 ? "" : ", ", mean[0], mean[1],
                    mean[2], mean[3]);
    }
    std::printf("]}\n");
}
