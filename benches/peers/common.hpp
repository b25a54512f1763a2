// What every peer in C++ reads, and how it is measured: as common/src/lib.rs does it.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

constexpr int PARTS = 10;
constexpr int SEEDS = 40, PARTICLES = 1000, STEPS = 20;

using Lines = std::vector<std::vector<double>>;

inline Lines lines(const std::string& file) {
    std::ifstream text(file);
    Lines found;
    for (std::string line; std::getline(text, line);) {
        std::istringstream words(line);
        found.emplace_back();
        for (double number; words >> number;) found.back().push_back(number);
    }
    return found;
}

// A still beacon, measured by level and bearing; a line of the sweep is receiver, level, bearing.
struct Beacon {
    double variance, drift, reference_dbm, exponent, level_sigma, bearing_sigma, alpha;
    Lines sweep;
    explicit Beacon(const std::string& file) : sweep(lines(file)) {
        const auto& first = sweep.front();
        variance = first[0], drift = first[1], reference_dbm = first[2], exponent = first[3];
        level_sigma = first[4], bearing_sigma = first[5], alpha = first[6];
        sweep.erase(sweep.begin());
    }
};

// A target of constant velocity, measured by bearings with outliers; a line of the sequence is
// receiver, bearing.
struct Bearings {
    std::vector<double> prior, spread;
    double noise, bias, sigma, share;
    Lines sequence;
    explicit Bearings(const std::string& file) : sequence(lines(file)) {
        const auto& first = sequence.front();
        prior.assign(first.begin(), first.begin() + 4);
        spread.assign(first.begin() + 4, first.begin() + 8);
        noise = first[8], bias = first[9], sigma = first[10], share = first[11];
        sequence.erase(sequence.begin());
    }
};

// Time of the processor, which does not count while others run.
inline double processor_ns() {
    timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return 1e9 * double(now.tv_sec) + double(now.tv_nsec);
}

template <typename Work> void measured(long repeats, double steps, Work work) {
    double least = std::numeric_limits<double>::infinity();
    for (int part = 0; part < PARTS; ++part) {
        double start = processor_ns();
        for (long i = 0; i < repeats; ++i) work();
        least = std::min(least, processor_ns() - start);
    }
    std::printf("{\"ns\": %.3f}\n", least / (double(repeats) * steps));
}
