// Procedural surface textures.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <vector>

#include "libvio/simulation/materials.h"

namespace vio {

/// Grey, periodic texture of a material: it has corners at every scale. Sampled bilinearly from a
/// pyramid, so that distant surfaces do not alias. It is made when it is first sampled, which may
/// be from several threads.
class Texture {
 public:
    /// texel: size of the finest texel on the surface [m]. side: texels per period, a power of two.
    Texture(Material material, std::uint64_t seed, double texel, int side = 1024);

    Material material() const { return material_; }

    /// Intensity 0..255 at surface coordinates (u, v) [m], averaged over about `footprint` [m].
    double sample(double u, double v, double footprint) const;

 private:
    // The pattern at one resolution: a square period, row by row, 0 to 255.
    struct Level {
        int side;
        double scale;  ///< side / side of the finest
        std::vector<float> texels;
        /// At x, y in texels of the finest level, where texel (0, 0) has its centre at (0, 0).
        double bilinear(double x, double y) const;
    };

    void make() const;

    Material material_;
    std::uint64_t seed_;
    double inverse_texel_;
    int side_;
    mutable std::once_flag made_;
    mutable std::atomic<bool> ready_{false};
    mutable std::vector<Level> levels_;
};

}  // namespace vio
