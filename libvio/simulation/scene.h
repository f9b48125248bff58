// Textured scenes to look at: solids whose surfaces can be hit by rays.
#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libvio/geometry/pose.h"
#include "libvio/simulation/texture.h"

namespace vio {

/// A box or ellipsoid with half extents along the axes of its own frame S.
struct Solid {
    enum class Shape { kBox, kEllipsoid };
    Shape shape = Shape::kBox;
    bool hollow = false;  ///< a box seen from inside (the walls of a room)
    Pose T_W_S;
    Eigen::Vector3d half_extent = Eigen::Vector3d::Ones();  ///< [m]
    int texture_idx = 0;
    int floor_texture_idx = -1, ceiling_texture_idx = -1;      ///< of z faces seen from inside
    Eigen::Vector2d texture_offset = Eigen::Vector2d::Zero();  ///< [m]
    double brightness = 1;                                     ///< factor on the texture
};

/// A ray's first encounter with a surface.
struct SurfaceHit {
    double distance = 0;  ///< along the unit direction [m]
    int solid_idx = -1;
    Eigen::Vector3d p_S = Eigen::Vector3d::Zero();  ///< point in the solid's frame [m]
    int axis = 0;                                   ///< axis of S that is closest to the normal
    double cosine = 1;                              ///< between the ray and the normal
    double shade = 1;                               ///< of the light on this surface
};

/// Where a scene is and how large.
struct SceneLayout {
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< of the scene, in W [m]
    Eigen::Vector3d room_size{8, 6, 3};                ///< along x, y and z [m]
};

/// Solids with materials, in W [m].
class Scene {
 public:
    /// Kinds: "arm_cell" (table with boxes, 0.7 to 1.5 m below a camera that looks down), "room"
    /// (of the layout's size, with furniture, origin at the middle of the floor), "crane_hall" (16
    /// x 16 m floor with objects, 8 m high), "outdoor" (plane with rocks and hills), "plane" (bare
    /// ground), "far_hills" (hills more than 300 m away, no ground). The ground or table is at z =
    /// 0. Throws InputError for another kind.
    static Scene make(const std::string& kind, std::uint64_t seed, const SceneLayout& layout = {});
    static const std::vector<std::string>& kinds();

    const std::vector<Solid>& solids() const { return solids_; }

    /// First surface along the ray; `candidates`, if given, limits the search to these solids.
    std::optional<SurfaceHit> cast(const Eigen::Vector3d& origin_W,
                                   const Eigen::Vector3d& direction_W,
                                   const std::vector<int>* candidates = nullptr) const;

    /// Light from a surface, 0..255. angle: angular size of a sample [rad].
    double intensity(const SurfaceHit& hit, double angle) const;
    /// Light from where no surface is, 0..255.
    double sky(const Eigen::Vector3d& direction_W) const;

 private:
    void paint(const std::string& kind, std::uint64_t seed, double texel);
    int texture_idx(const SurfaceHit& hit) const;

    std::vector<Solid> solids_;
    std::vector<std::shared_ptr<const Texture>> textures_;
};

}  // namespace vio
