// Random numbers whose bytes do not depend on the standard library or on the order of threads.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <string_view>

namespace vio {

/// Bijective 64-bit mixer (splitmix64): decorrelates neighbouring seeds and counters.
inline constexpr std::uint64_t mixed(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15ULL;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
    return x ^ (x >> 31);
}

/// Stream of random numbers. Streams with different names are independent for the same seed, so
/// that, say, more image noise does not change the IMU's.
class Random {
 public:
    Random(std::uint64_t seed, std::string_view stream) : engine_(stream_seed(seed, stream)) {}

    /// In [0, 1).
    double uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
    double uniform(double min, double max) { return min + (max - min) * uniform(); }
    int below(int n) { return static_cast<int>(uniform() * n); }

    /// Standard normal (Box-Muller).
    double normal() {
        if (has_spare_) {
            has_spare_ = false;
            return spare_;
        }
        const double r = std::sqrt(-2 * std::log(1 - uniform()));
        const double angle = 2 * std::numbers::pi * uniform();
        spare_ = r * std::sin(angle);
        has_spare_ = true;
        return r * std::cos(angle);
    }
    Eigen::Vector3d normal3() {
        const double x = normal(), y = normal(), z = normal();
        return {x, y, z};
    }
    Eigen::Vector2d normal2() {
        const double x = normal(), y = normal();
        return {x, y};
    }

    static constexpr std::uint64_t stream_seed(std::uint64_t seed, std::string_view stream) {
        std::uint64_t h = mixed(seed);
        for (const char c : stream) h = mixed(h ^ static_cast<unsigned char>(c));
        return h;
    }

 private:
    std::mt19937_64 engine_;
    double spare_ = 0;
    bool has_spare_ = false;
};

}  // namespace vio
