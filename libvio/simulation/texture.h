// Procedural surface textures.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <vector>

namespace vio {

/// Grey, periodic texture: opaque leaves (rotated rectangles and discs of all sizes, the newest on
/// top; the "dead leaves" model, whose statistics are those of natural images) over and under
/// several octaves of gradient noise. It has corners at every scale. Sampled bilinearly from a
/// pyramid, so that distant surfaces do not alias. It is made when it is first sampled, which may
/// be from several threads.
class Texture {
 public:
    /// texel: size of the finest texel on the surface [m]. side: texels per period, a power of two.
    Texture(std::uint64_t seed, double texel, int side = 1024);

    /// Intensity 0..255 at surface coordinates (u, v) [m], averaged over about `footprint` [m].
    double sample(double u, double v, double footprint) const;

 private:
    struct Level {
        int side;
        double scale;  ///< side / side of the finest
        std::vector<float> texels;
        /// At x, y in texels of the finest level, where texel (0, 0) has its centre at (0, 0).
        double bilinear(double x, double y) const;
    };

    void make() const;

    std::uint64_t seed_;
    double inverse_texel_;
    int side_;
    mutable std::once_flag made_;
    mutable std::atomic<bool> ready_{false};
    mutable std::vector<Level> levels_;
};

}  // namespace vio
