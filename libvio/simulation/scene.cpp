#include "libvio/simulation/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "libvio/base/errors.h"
#include "libvio/simulation/random.h"

namespace vio {
namespace {

constexpr double kNearest = 1e-6;  // [m]
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct LocalHit {
    double distance;
    int axis;
    Eigen::Vector3d normal;
};

std::optional<LocalHit> hit_box(const Solid& solid, const Eigen::Vector3d& o,
                                const Eigen::Vector3d& d) {
    double enter = -kInfinity, leave = kInfinity;
    int enter_axis = 0, leave_axis = 0;
    for (int i = 0; i < 3; ++i) {
        const double h = solid.half_extent[i];
        if (d[i] == 0) {
            if (std::abs(o[i]) > h) return std::nullopt;
            continue;
        }
        const double inverse = 1 / d[i];
        const double a = (-h - o[i]) * inverse, b = (h - o[i]) * inverse;
        const double near = std::min(a, b), far = std::max(a, b);
        if (near > enter) enter = near, enter_axis = i;
        if (far < leave) leave = far, leave_axis = i;
    }
    if (enter > leave) return std::nullopt;
    const double distance = solid.hollow ? leave : enter;
    if (distance < kNearest) return std::nullopt;
    const int axis = solid.hollow ? leave_axis : enter_axis;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    normal[axis] = d[axis] > 0 ? -1 : 1;
    return LocalHit{distance, axis, normal};
}

std::optional<LocalHit> hit_ellipsoid(const Solid& solid, const Eigen::Vector3d& o,
                                      const Eigen::Vector3d& d) {
    const Eigen::Vector3d os = o.cwiseQuotient(solid.half_extent);
    const Eigen::Vector3d ds = d.cwiseQuotient(solid.half_extent);
    const double a = ds.squaredNorm(), b = os.dot(ds), c = os.squaredNorm() - 1;
    const double discriminant = b * b - a * c;
    if (discriminant < 0) return std::nullopt;
    const double distance = (-b - std::sqrt(discriminant)) / a;
    if (distance < kNearest) return std::nullopt;
    const Eigen::Vector3d normal =
        (os + distance * ds).cwiseQuotient(solid.half_extent).normalized();
    int axis = 0;
    normal.cwiseAbs().maxCoeff(&axis);
    return LocalHit{distance, axis, normal};
}

Pose upright(double x, double y, double z, double yaw) {
    return {Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {x, y, z}};
}

// Puts solids into a scene with random textures and brightness.
class Builder {
 public:
    Builder(std::vector<Solid>& solids, std::vector<std::shared_ptr<const Texture>>& textures,
            std::uint64_t seed, double texel)
        : solids_(solids), textures_(textures), random_(seed, "scene") {
        constexpr int kTextures = 4;
        for (int i = 0; i < kTextures; ++i)
            textures_.push_back(std::make_shared<Texture>(
                Material::kClutter, Random::stream_seed(seed, "texture") + i, texel));
    }

    Random& random() { return random_; }

    void solid(const Pose& T_W_S, const Eigen::Vector3d& half_extent,
               Solid::Shape shape = Solid::Shape::kBox, bool hollow = false) {
        Solid s;
        s.shape = shape;
        s.hollow = hollow;
        s.T_W_S = T_W_S;
        s.half_extent = half_extent;
        s.texture_idx = random_.below(static_cast<int>(textures_.size()));
        s.texture_offset = {random_.uniform(0, 50), random_.uniform(0, 50)};
        s.brightness = random_.uniform(0.75, 1.1);
        solids_.push_back(s);
    }

    /// A slab whose upper face is at z = 0.
    void ground(double half_side) { solid(upright(0, 0, -0.5, 0), {half_side, half_side, 0.5}); }

    /// Boxes that stand on z = 0 within |x|, |y| < reach.
    void boxes(int n, double reach, double min_half, double max_half, double min_height,
               double max_height) {
        for (int i = 0; i < n; ++i) {
            const double x = random_.uniform(-reach, reach), y = random_.uniform(-reach, reach);
            box_at(x, y, min_half, max_half, min_height, max_height);
        }
    }

    void box_at(double x, double y, double min_half, double max_half, double min_height,
                double max_height) {
        const double yaw = random_.uniform(0, 3.14159265), a = random_.uniform(min_half, max_half),
                     b = random_.uniform(min_half, max_half),
                     h = random_.uniform(min_height, max_height) / 2;
        solid(upright(x, y, h, yaw), {a, b, h});
    }

    /// Hills all around, at distances and of half widths within the limits.
    void hills(int n, double nearest, double furthest, double smallest, double largest) {
        for (int i = 0; i < n; ++i) {
            const double angle = random_.uniform(0, 6.2831853),
                         r = random_.uniform(nearest, furthest);
            const double size = random_.uniform(smallest, largest);
            solid(upright(r * std::cos(angle), r * std::sin(angle), -0.2 * size, angle),
                  {size, 1.5 * size, random_.uniform(0.3, 0.7) * size}, Solid::Shape::kEllipsoid);
        }
    }

 private:
    std::vector<Solid>& solids_;
    std::vector<std::shared_ptr<const Texture>>& textures_;
    Random random_;
};

void make_arm_cell(Builder& build) {
    build.ground(3);
    build.solid(upright(0, 0, 1.5, 0), {3, 3, 2.2}, Solid::Shape::kBox, true);
    build.boxes(40, 1.1, 0.05, 0.16, 0.04, 0.35);
}

void make_room(Builder& build, const Eigen::Vector3d& size) {
    const Eigen::Vector3d half = size / 2;
    build.solid(upright(0, 0, half.z(), 0), half, Solid::Shape::kBox, true);
    const int pieces = static_cast<int>(std::lround(0.5 * (size.x() + size.y())));
    const double x_wall = half.x() - 0.4, y_wall = half.y() - 0.4;
    for (int i = 0; i < 2 * pieces; ++i) {  // along the walls, so that the middle stays free
        const double side = build.random().uniform(-1, 1);
        const bool along_x = build.random().uniform() < 0.5;
        const double sign = build.random().uniform() < 0.5 ? -1 : 1;
        build.box_at(along_x ? (half.x() - 0.5) * side : sign * x_wall,
                     along_x ? sign * y_wall : (half.y() - 0.5) * side, 0.15, 0.45, 0.4,
                     std::min(2.0, 0.8 * size.z()));
    }
}

void make_crane_hall(Builder& build) {
    build.ground(8);
    build.solid(upright(0, 0, 4, 0), {8, 8, 4.2}, Solid::Shape::kBox, true);
    build.boxes(110, 7, 0.1, 0.5, 0.05, 1.2);
}

void make_outdoor(Builder& build) {
    build.ground(400);
    Random& random = build.random();
    for (int i = 0; i < 700; ++i) {
        const double x = random.uniform(-45, 45), y = random.uniform(-45, 45);
        const double size = 0.05 / std::sqrt(1 - 0.995 * random.uniform());
        const Eigen::Vector3d half(size, size * random.uniform(0.6, 1),
                                   size * random.uniform(0.4, 0.9));
        build.solid(upright(x, y, 0.2 * half.z(), random.uniform(0, 3.14)), half,
                    Solid::Shape::kEllipsoid);
    }
    build.hills(60, 120, 350, 10, 40);
}

}  // namespace

const std::vector<std::string>& Scene::kinds() {
    static const std::vector<std::string> all{"arm_cell", "room",  "crane_hall",
                                              "outdoor",  "plane", "far_hills"};
    return all;
}

Scene Scene::make(const std::string& kind, std::uint64_t seed, const SceneLayout& layout) {
    const double texel = kind == "arm_cell"    ? 0.0025
                         : kind == "room"      ? 0.003
                         : kind == "far_hills" ? 0.5
                                               : 0.008;
    Scene scene;
    Builder build(scene.solids_, scene.textures_, seed, texel);
    if (kind == "arm_cell")
        make_arm_cell(build);
    else if (kind == "room")
        make_room(build, layout.room_size);
    else if (kind == "crane_hall")
        make_crane_hall(build);
    else if (kind == "outdoor")
        make_outdoor(build);
    else if (kind == "plane")
        build.ground(50);
    else if (kind == "far_hills")
        build.hills(90, 600, 1200, 60, 160);
    else
        throw InputError("scenario [scene] kind: no scene '" + kind +
                         "'; use arm_cell, room, crane_hall, outdoor, plane or far_hills");
    scene.paint(kind, seed, texel);
    for (Solid& solid : scene.solids_) solid.T_W_S.p += layout.origin;
    return scene;
}

// Gives solids the material that they are made of, some of the boxes excepted: things with much on
// them. The table of the arm cell is all clutter.
void Scene::paint(const std::string& kind, std::uint64_t seed, double texel) {
    if (kind == "arm_cell") return;
    std::array<int, 6> idx{};
    const auto of = [&](Material material, int side) {
        int& i = idx[static_cast<size_t>(material)];
        if (i == 0) {
            i = static_cast<int>(textures_.size());
            textures_.push_back(std::make_shared<Texture>(
                material, Random::stream_seed(seed, "material") + static_cast<std::uint64_t>(i),
                texel, side));
        }
        return i;
    };
    const bool outside = kind != "room" && kind != "crane_hall";
    for (size_t i = 0; i < solids_.size(); ++i) {
        Solid& solid = solids_[i];
        if (solid.hollow) {
            solid.texture_idx = of(Material::kWall, 2048);
            solid.floor_texture_idx = of(Material::kPlanks, 1024);
            solid.ceiling_texture_idx = of(Material::kConcrete, 1024);
            solid.brightness = 1;
        } else if (solid.shape == Solid::Shape::kEllipsoid) {
            solid.texture_idx = of(Material::kRock, 1024);
        } else if (i == 0) {
            solid.texture_idx = of(outside ? Material::kSoil : Material::kConcrete, 2048);
        } else if (i % 3 == 0) {
            solid.texture_idx = of(Material::kPlanks, 1024);
        }
    }
}

int Scene::texture_idx(const SurfaceHit& hit) const {
    const Solid& solid = solids_[hit.solid_idx];
    if (hit.axis != 2) return solid.texture_idx;
    const int other = hit.p_S.z() < 0 ? solid.floor_texture_idx : solid.ceiling_texture_idx;
    return other < 0 ? solid.texture_idx : other;
}

std::optional<SurfaceHit> Scene::cast(const Eigen::Vector3d& origin_W,
                                      const Eigen::Vector3d& direction_W,
                                      const std::vector<int>* candidates) const {
    // Fixed light from above and to one side.
    const Eigen::Vector3d light = Eigen::Vector3d(0.35, 0.2, 0.9).normalized();
    std::optional<LocalHit> nearest;
    SurfaceHit hit;
    Eigen::Vector3d direction_S;
    const auto test = [&](int i) {
        const Solid& solid = solids_[i];
        const Eigen::Matrix3d& R = solid.T_W_S.R;
        const Eigen::Vector3d o = R.transpose() * (origin_W - solid.T_W_S.p);
        const Eigen::Vector3d d = R.transpose() * direction_W;
        const auto local =
            solid.shape == Solid::Shape::kBox ? hit_box(solid, o, d) : hit_ellipsoid(solid, o, d);
        if (!local || (nearest && local->distance >= nearest->distance)) return;
        nearest = local;
        hit.solid_idx = i;
        hit.p_S = o + local->distance * d;
        direction_S = d;
    };
    if (candidates)
        for (const int i : *candidates) test(i);
    else
        for (int i = 0; i < static_cast<int>(solids_.size()); ++i) test(i);
    if (!nearest) return std::nullopt;
    hit.distance = nearest->distance;
    hit.axis = nearest->axis;
    hit.cosine = std::abs(nearest->normal.dot(direction_S));
    hit.shade =
        0.72 + 0.28 * std::abs((solids_[hit.solid_idx].T_W_S.R * nearest->normal).dot(light));
    return hit;
}

double Scene::intensity(const SurfaceHit& hit, double angle) const {
    const Solid& solid = solids_[hit.solid_idx];
    const Texture& texture = *textures_[texture_idx(hit)];
    int i = (hit.axis + 1) % 3, j = (hit.axis + 2) % 3;
    if (hit.axis == 1 && is_directed(texture.material())) std::swap(i, j);  // v is up on walls
    const double u = hit.p_S[i] + solid.texture_offset.x() + 17.3 * hit.axis;
    const double v = hit.p_S[j] + solid.texture_offset.y() + (hit.p_S[hit.axis] < 0 ? 5.1 : 0);
    const double footprint = hit.distance * angle / std::sqrt(std::max(hit.cosine, 0.02));
    const double light = solid.brightness * hit.shade;
    return std::min(255.0, light * texture.sample(u, v, footprint));
}

double Scene::sky(const Eigen::Vector3d& direction_W) const {
    return 235 - 40 * std::max(0.0, direction_W.z());
}

}  // namespace vio
