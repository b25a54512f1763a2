// A receiver for SoapySDR that plays a file of unsigned bytes in real time: it loses samples, and falls
// silent until it is opened again, where its arguments say so. Times are in seconds of the file.
#include <SoapySDR/Device.hpp>
#include <SoapySDR/Errors.hpp>
#include <SoapySDR/Formats.hpp>
#include <SoapySDR/Registry.hpp>

#include <algorithm>
#include <chrono>
#include <complex>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

using Clock = std::chrono::steady_clock;

// The air does not begin anew when a receiver is opened again.
static const Clock::time_point begin = Clock::now();
static int opened = 0;

class Replay : public SoapySDR::Device {
public:
    explicit Replay(const SoapySDR::Kwargs &args)
        : rate_(0), next_(0), lost_at_(number(args, "lost_at")), lost_s_(number(args, "lost_s")),
          silent_at_(number(args, "silent_at")), has_time_(args.count("clock") > 0) {
        std::ifstream file(args.at("file"), std::ios::binary);
        if (!file) throw std::runtime_error("no file " + args.at("file"));
        bytes_.assign(std::istreambuf_iterator<char>(file), {});
        opened += 1;
    }

    std::string getDriverKey() const override { return "replay"; }
    std::string getHardwareKey() const override { return "a file"; }
    size_t getNumChannels(const int direction) const override { return direction == SOAPY_SDR_RX; }
    std::vector<std::string> getStreamFormats(const int, const size_t) const override { return {SOAPY_SDR_CF32}; }
    std::string getNativeStreamFormat(const int, const size_t, double &full_scale) const override {
        full_scale = 127.5;
        return SOAPY_SDR_CS8;
    }
    void setSampleRate(const int, const size_t, const double rate) override { rate_ = rate; }
    double getSampleRate(const int, const size_t) const override { return rate_; }
    void setFrequency(const int, const size_t, const std::string &name, const double value, const SoapySDR::Kwargs &) override {
        std::fprintf(stderr, "replay: %s %.1f\n", name.c_str(), value);
    }
    std::vector<std::string> listFrequencies(const int, const size_t) const override { return {"RF", "CORR"}; }
    void setFrequency(const int, const size_t, const double value, const SoapySDR::Kwargs &) override {
        std::fprintf(stderr, "replay: RF %.1f\n", value);
    }
    bool hasGainMode(const int, const size_t) const override { return true; }
    void setGainMode(const int, const size_t, const bool automatic) override {
        std::fprintf(stderr, "replay: automatic gain %d\n", automatic);
    }
    void setGain(const int, const size_t, const double value) override { std::fprintf(stderr, "replay: gain %.1f\n", value); }
    bool hasHardwareTime(const std::string &) const override { return has_time_; }

    SoapySDR::Stream *setupStream(const int, const std::string &format, const std::vector<size_t> &, const SoapySDR::Kwargs &) override {
        if (format != SOAPY_SDR_CF32) throw std::runtime_error("only CF32");
        return reinterpret_cast<SoapySDR::Stream *>(this);
    }
    void closeStream(SoapySDR::Stream *) override {}
    int activateStream(SoapySDR::Stream *, const int, const long long, const size_t) override {
        next_ = static_cast<size_t>(elapsed() * rate_);
        return 0;
    }
    int deactivateStream(SoapySDR::Stream *, const int, const long long) override { return 0; }

    int readStream(SoapySDR::Stream *, void *const *buffers, const size_t wanted, int &flags, long long &time_ns, const long timeout_us) override {
        const auto until = Clock::now() + std::chrono::microseconds(timeout_us);
        const bool silent = opened == 1 && silent_at_ > 0 && elapsed() > silent_at_;
        if (lost_at_ > 0 && next_ >= static_cast<size_t>(lost_at_ * rate_)) {
            if (elapsed() < lost_at_ + lost_s_) {
                std::this_thread::sleep_until(until);
                return SOAPY_SDR_TIMEOUT;
            }
            next_ += static_cast<size_t>(lost_s_ * rate_);
            lost_at_ = 0;
            return SOAPY_SDR_OVERFLOW;
        }
        // What a driver hands on at a time.
        const size_t block = std::min<size_t>(wanted, 8192);
        while (silent || static_cast<size_t>(elapsed() * rate_) < next_ + block) {
            if (Clock::now() >= until) return SOAPY_SDR_TIMEOUT;
            std::this_thread::sleep_for(std::chrono::microseconds(200));
        }
        if (2 * (next_ + block) > bytes_.size()) return SOAPY_SDR_TIMEOUT;
        auto *out = static_cast<std::complex<float> *>(buffers[0]);
        auto of = [&](size_t at) { return (static_cast<float>(static_cast<uint8_t>(bytes_[at])) - 127.5f) / 127.5f; };
        for (size_t i = 0; i < block; ++i) out[i] = {of(2 * (next_ + i)), of(2 * (next_ + i) + 1)};
        flags = has_time_ ? SOAPY_SDR_HAS_TIME : 0;
        time_ns = has_time_ ? static_cast<long long>(static_cast<double>(next_) / rate_ * 1e9) : 0;
        next_ += block;
        return static_cast<int>(block);
    }

private:
    static double number(const SoapySDR::Kwargs &args, const char *name) {
        return args.count(name) ? std::stod(args.at(name)) : 0.0;
    }
    static double elapsed() { return std::chrono::duration<double>(Clock::now() - begin).count(); }

    std::vector<char> bytes_;
    double rate_;
    size_t next_;
    double lost_at_, lost_s_, silent_at_;
    bool has_time_;
};

static SoapySDR::KwargsList find(const SoapySDR::Kwargs &args) {
    if (args.count("driver") && args.at("driver") != "replay") return {};
    SoapySDR::Kwargs found;
    found["driver"] = "replay";
    found["label"] = "plays a file";
    if (args.count("file")) found["file"] = args.at("file");
    return {found};
}
static SoapySDR::Device *make(const SoapySDR::Kwargs &args) { return new Replay(args); }
static SoapySDR::Registry registry("replay", &find, &make, SOAPY_SDR_ABI_VERSION);
