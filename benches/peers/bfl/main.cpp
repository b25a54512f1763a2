// Orocos BFL: its extended filter.
#include "../common.hpp"
#include <filter/extendedkalmanfilter.h>
#include <model/analyticmeasurementmodel_gaussianuncertainty.h>
#include <model/linearanalyticsystemmodel_gaussianuncertainty.h>
#include <pdf/analyticconditionalgaussian_additivenoise.h>
#include <pdf/linearanalyticconditionalgaussian.h>

using namespace BFL;
using namespace MatrixWrapper;

static SymmetricMatrix diagonal(double a, double b) {
    SymmetricMatrix matrix(2);
    matrix = 0.0;
    matrix(1, 1) = a;
    matrix(2, 2) = b;
    return matrix;
}

static ColumnVector zeros() {
    ColumnVector vector(2);
    vector = 0.0;
    return vector;
}

// Level and bearing of a state, from a receiver.
class LevelBearing : public AnalyticConditionalGaussianAdditiveNoise {
public:
    LevelBearing(const Beacon& beacon, const Gaussian& noise)
        : AnalyticConditionalGaussianAdditiveNoise(noise, 1), beacon(beacon) {}
    const double* receiver = nullptr;

    ColumnVector ExpectedValueGet() const override {
        auto [x, y, square] = relative();
        ColumnVector expected(2);
        expected(1) = beacon.reference_dbm - 10 * beacon.exponent * std::log10(std::sqrt(square));
        expected(2) = std::atan2(y, x);
        return expected;
    }
    Matrix dfGet(unsigned int) const override {
        auto [x, y, square] = relative();
        double flat = x * x + y * y, slope = -10 * beacon.exponent / std::log(10.0) / square;
        Matrix h(2, 2);
        h(1, 1) = slope * x, h(1, 2) = slope * y;
        h(2, 1) = -y / flat, h(2, 2) = x / flat;
        return h;
    }

private:
    struct Relative { double x, y, square; };
    const Beacon& beacon;
    Relative relative() const {
        const ColumnVector& state = ConditionalArgumentGet(0);
        double x = state(1) - receiver[0], y = state(2) - receiver[1];
        return {x, y, x * x + y * y + receiver[2] * receiver[2]};
    }
};

int main(int count, char** arguments) {
    if (count != 5 || std::string(arguments[1]) != "ekf") return 2;
    Beacon beacon(arguments[2]);
    long repeats = std::atol(arguments[3]);
    double q = beacon.drift * beacon.drift;
    Matrix still(2, 2);
    still = 0.0;
    still(1, 1) = still(2, 2) = 1.0;
    LinearAnalyticConditionalGaussian motion_pdf(still, Gaussian(zeros(), diagonal(q, q)));
    LinearAnalyticSystemModelGaussianUncertainty motion(&motion_pdf);
    Gaussian noise(zeros(), diagonal(beacon.level_sigma * beacon.level_sigma,
                                     beacon.bearing_sigma * beacon.bearing_sigma));
    LevelBearing measurement_pdf(beacon, noise);
    AnalyticMeasurementModelGaussianUncertainty measurement(&measurement_pdf);
    Gaussian prior(zeros(), diagonal(beacon.variance, beacon.variance));
    ExtendedKalmanFilter filter(&prior);
    auto sweep = [&] {
        for (const auto& line : beacon.sweep) {
            ColumnVector z(2);
            z(1) = line[3], z(2) = line[4];
            measurement_pdf.receiver = line.data();
            filter.Update(&motion);
            filter.Update(&measurement, z);
        }
    };
    if (repeats > 0) {
        measured(repeats, double(beacon.sweep.size()), sweep);
        return 0;
    }
    sweep();
    ColumnVector x = filter.PostGet()->ExpectedValueGet();
    SymmetricMatrix p = filter.PostGet()->CovarianceGet();
    std::printf("{\"mean\": [%.17g, %.17g], ", x(1), x(2));
    std::printf("\"covariance\": [%.17g, %.17g, ", p(1, 1), p(1, 2));
    std::printf("%.17g, %.17g]}\n", p(2, 1), p(2, 2));
}
