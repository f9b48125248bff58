// What surfaces look like: procedural grey patterns.
#pragma once

#include <cstdint>
#include <vector>

namespace vio {

/// Which pattern a surface shows.
enum class Material {
    kClutter,   ///< opaque leaves: rectangles and discs of all sizes
    kWall,      ///< bricks, with posters here and there
    kPlanks,    ///< wooden boards with grain and joints
    kConcrete,  ///< stains, grains and the joints of slabs
    kSoil,      ///< earth and pebbles
    kRock       ///< speckled stone
};

/// Whether the pattern has an upright direction (rows run along u).
constexpr bool is_directed(Material material) {
    return material == Material::kWall || material == Material::kPlanks;
}

/// Intensities 0..255 of a square of side x side texels, row by row, periodic in both directions.
/// side: a power of two, at least 256.
std::vector<float> material_texels(Material material, std::uint64_t seed, int side);

}  // namespace vio
