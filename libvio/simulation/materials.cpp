#include "libvio/simulation/materials.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "libvio/simulation/random.h"

namespace vio {
namespace {

class Torus {
 public:
    explicit Torus(int side) : side_(side), texels_(static_cast<size_t>(side) * side, 0.0F) {}
    float& at(int x, int y) {
        return texels_[static_cast<size_t>(y & (side_ - 1)) * side_ + (x & (side_ - 1))];
    }
    float at(int x, int y) const {
        return texels_[static_cast<size_t>(y & (side_ - 1)) * side_ + (x & (side_ - 1))];
    }
    int side() const { return side_; }
    std::vector<float> take() { return std::move(texels_); }

 private:
    int side_;
    std::vector<float> texels_;
};

// Adds gradient noise of `cells` lattice cells per period; side is a multiple of cells.
void add_gradient_noise(Torus& torus, std::uint64_t seed, int cells, double amplitude) {
    struct Gradient {
        double x, y;
    };
    std::vector<Gradient> gradients;
    for (int cy = 0; cy < cells; ++cy)
        for (int cx = 0; cx < cells; ++cx) {
            const std::uint64_t h = mixed(seed ^ mixed((static_cast<std::uint64_t>(cy) << 32) |
                                                       static_cast<std::uint64_t>(cx)));
            const double angle = 2 * std::numbers::pi * static_cast<double>(h >> 11) * 0x1p-53;
            gradients.push_back({std::cos(angle), std::sin(angle)});
        }
    const auto gradient = [&](int cx, int cy) {
        return gradients[cy % cells * cells + cx % cells];
    };
    const auto slope = [](const Gradient& g, double dx, double dy) { return g.x * dx + g.y * dy; };
    const auto fade = [](double s) { return s * s * s * (s * (6 * s - 15) + 10); };
    const int side = torus.side(), cell = side / cells;
    std::vector<double> offsets, fades;  // along a cell
    for (int i = 0; i < cell; ++i) {
        offsets.push_back(static_cast<double>(i) * cells / side);
        fades.push_back(fade(offsets.back()));
    }
    for (int y = 0; y < side; ++y) {
        const int cy = y / cell;
        const double dy = offsets[y % cell], fy = fades[y % cell];
        for (int cx = 0; cx < cells; ++cx) {
            const Gradient g00 = gradient(cx, cy), g10 = gradient(cx + 1, cy),
                           g01 = gradient(cx, cy + 1), g11 = gradient(cx + 1, cy + 1);
            for (int i = 0; i < cell; ++i) {
                const double dx = offsets[i], fx = fades[i];
                const double top = std::lerp(slope(g00, dx, dy), slope(g10, dx - 1, dy), fx);
                const double bottom =
                    std::lerp(slope(g01, dx, dy - 1), slope(g11, dx - 1, dy - 1), fx);
                torus.at(cx * cell + i, y) +=
                    static_cast<float>(amplitude * std::lerp(top, bottom, fy));
            }
        }
    }
}

// Opaque leaves of a random size; the edge is softened over about a texel.
struct Leaves {
    double smallest = 7, largest = 90;  // half sizes [texels], density ~ size^-3
    double flattest = 0.4;              // ratio of the sides
    double discs = 0.2;                 // share that is round
    double darkest = 25, brightest = 230;
    double relief = 0;  // brighter on one side, darker on the other, by so many grey levels
};

void lay_leaf(Torus& torus, const Leaves& leaves, Random& random) {
    const double s = random.uniform();
    const double half =
        leaves.smallest / std::sqrt(1 - s * (1 - std::pow(leaves.smallest / leaves.largest, 2)));
    const double aspect = random.uniform(leaves.flattest, 1);
    const double angle = random.uniform(0, std::numbers::pi);
    const bool disc = random.uniform() < leaves.discs;
    const double grey = random.uniform(leaves.darkest, leaves.brightest);
    const double cx = random.uniform(0, torus.side()), cy = random.uniform(0, torus.side());
    const double c = std::cos(angle), sn = std::sin(angle), a = half, b = half * aspect;
    const int reach = static_cast<int>(std::ceil(std::hypot(a, b))) + 1;
    for (int y = static_cast<int>(cy) - reach; y <= static_cast<int>(cy) + reach; ++y)
        for (int x = static_cast<int>(cx) - reach; x <= static_cast<int>(cx) + reach; ++x) {
            const double dx = x - cx, dy = y - cy;
            const double p = c * dx + sn * dy, q = -sn * dx + c * dy;
            const double inside =
                disc ? b - std::hypot(p, q) : std::min(a - std::abs(p), b - std::abs(q));
            const double cover = std::clamp(inside / 1.4 + 0.5, 0.0, 1.0);
            if (cover <= 0) continue;
            float& texel = torus.at(x & (torus.side() - 1), y & (torus.side() - 1));
            const double lit = grey + leaves.relief * (dx - dy) / (1.5 * half);
            texel += static_cast<float>(cover * (lit - texel));
        }
}

void fill(Torus& torus, double grey) {
    for (int y = 0; y < torus.side(); ++y)
        for (int x = 0; x < torus.side(); ++x) torus.at(x, y) = static_cast<float>(grey);
}

// Several octaves, each half as strong as the one before.
void add_octaves(Torus& torus, std::uint64_t seed, int coarsest_cells, int octaves,
                 double amplitude) {
    for (int k = 0; k < octaves; ++k)
        add_gradient_noise(torus, mixed(seed + k), std::min(coarsest_cells << k, torus.side()),
                           amplitude / (1 << k));
}

Torus clutter(std::uint64_t seed, int side) {
    Torus torus(side);
    Random random(seed, "texture");
    add_gradient_noise(torus, mixed(seed), 8, 60);
    const int leaves = side * side / 300;
    for (int i = 0; i < leaves; ++i) lay_leaf(torus, {}, random);
    add_octaves(torus, seed + 1, side / 128, 3, 40);
    return torus;
}

// Rectangles in staggered rows with joints between them.
void lay_courses(Torus& torus, Random& random, int length, int height, int joint, double darkest,
                 double brightest, double joint_grey) {
    for (int row = 0; row < torus.side() / height; ++row) {
        const int shift = random.below(length);
        for (int k = 0; k < torus.side() / length; ++k) {
            const double grey = random.uniform(darkest, brightest);
            for (int y = 0; y < height; ++y)
                for (int x = 0; x < length; ++x)
                    torus.at(shift + k * length + x, row * height + y) =
                        static_cast<float>(x < joint || y < joint ? joint_grey : grey);
        }
    }
}

void hang_posters(Torus& torus, std::uint64_t seed, Random& random, int count) {
    const Torus pictures = clutter(seed, 512);
    constexpr int kBorder = 5;
    for (int i = 0; i < count; ++i) {
        const int w = 110 + random.below(150), h = 80 + random.below(150);
        const int left = random.below(torus.side()), top = random.below(torus.side());
        const int from_x = random.below(512), from_y = random.below(512);
        for (int y = 0; y < h; ++y)
            for (int x = 0; x < w; ++x) {
                const bool border =
                    x < kBorder || y < kBorder || x >= w - kBorder || y >= h - kBorder;
                torus.at(left + x, top + y) =
                    border ? 225 : 30 + 0.8F * pictures.at(from_x + x, from_y + y);
            }
    }
}

Torus wall(std::uint64_t seed, int side) {
    Torus torus(side);
    Random random(seed, "wall");
    lay_courses(torus, random, 64, 32, 3, 105, 160, 185);
    add_octaves(torus, seed, side / 64, 4, 26);
    hang_posters(torus, seed + 9, random, side * side / 190000);
    return torus;
}

Torus planks(std::uint64_t seed, int side) {
    Torus torus(side);
    Random random(seed, "planks");
    lay_courses(torus, random, 256, 32, 2, 110, 175, 40);
    Torus grain(side);
    add_octaves(grain, seed, side / 16, 3, 60);
    for (int y = 0; y < side; ++y)  // drawn out along the boards
        for (int x = 0; x < side; ++x) torus.at(x, y) += grain.at(x / 8, y);
    const Leaves knots{2, 8, 0.6, 1, 50, 90};
    for (int i = 0; i < side * side / 9000; ++i) lay_leaf(torus, knots, random);
    return torus;
}

Torus concrete(std::uint64_t seed, int side) {
    Torus torus(side);
    Random random(seed, "concrete");
    fill(torus, 135);
    add_octaves(torus, seed, 8, 6, 60);
    const Leaves stains{6, 60, 0.5, 0.6, 85, 185}, grains{1.5, 5, 0.6, 0.7, 60, 210};
    for (int i = 0; i < side * side / 6000; ++i) lay_leaf(torus, stains, random);
    for (int i = 0; i < side * side / 250; ++i) lay_leaf(torus, grains, random);
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
            if (x % 256 < 2 || y % 256 < 2) torus.at(x, y) = 55;
    return torus;
}

Torus soil(std::uint64_t seed, int side) {
    Torus torus(side);
    Random random(seed, "soil");
    fill(torus, 115);
    add_octaves(torus, seed, 4, 8, 80);
    const Leaves pebbles{2, 30, 0.6, 0.85, 80, 190, 35};
    for (int i = 0; i < side * side / 220; ++i) lay_leaf(torus, pebbles, random);
    add_octaves(torus, seed + 20, side / 16, 2, 14);
    return torus;
}

Torus rock(std::uint64_t seed, int side) {
    Torus torus(side);
    Random random(seed, "rock");
    fill(torus, 150);
    add_octaves(torus, seed, 16, 6, 70);
    const Leaves speckles{2, 14, 0.3, 0.4, 60, 220};
    for (int i = 0; i < side * side / 400; ++i) lay_leaf(torus, speckles, random);
    add_octaves(torus, seed + 20, side / 16, 2, 20);
    return torus;
}

}  // namespace

std::vector<float> material_texels(Material material, std::uint64_t seed, int side) {
    switch (material) {
        case Material::kWall:
            return wall(seed, side).take();
        case Material::kPlanks:
            return planks(seed, side).take();
        case Material::kConcrete:
            return concrete(seed, side).take();
        case Material::kSoil:
            return soil(seed, side).take();
        case Material::kRock:
            return rock(seed, side).take();
        case Material::kClutter:
            break;
    }
    return clutter(seed, side).take();
}

}  // namespace vio
