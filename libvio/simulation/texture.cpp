#include "libvio/simulation/texture.h"

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

// One leaf: its edge is softened over about a texel.
void lay_leaf(Torus& torus, Random& random) {
    constexpr double kSmallest = 7, kLargest = 90;  // half sizes [texels], density ~ size^-3
    const double s = random.uniform();
    const double half = kSmallest / std::sqrt(1 - s * (1 - std::pow(kSmallest / kLargest, 2)));
    const double aspect = random.uniform(0.4, 1), angle = random.uniform(0, std::numbers::pi);
    const bool disc = random.uniform() < 0.2;
    const double grey = random.uniform(25, 230);
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
            texel += static_cast<float>(cover * (grey - texel));
        }
}

}  // namespace

Texture::Texture(std::uint64_t seed, double texel, int side)
    : seed_(seed), inverse_texel_(1 / texel), side_(side) {}

void Texture::make() const {
    const int side = side_;
    Torus torus(side);
    Random random(seed_, "texture");
    add_gradient_noise(torus, mixed(seed_), 8, 60);
    const int leaves = side * side / 300;
    for (int i = 0; i < leaves; ++i) lay_leaf(torus, random);
    for (int octave = 0; octave < 3; ++octave)
        add_gradient_noise(torus, mixed(seed_ + 1 + octave), side / 128 << octave,
                           40.0 / (1 << octave));
    std::vector<float> texels = torus.take();
    for (float& t : texels) t = std::clamp(t, 0.0F, 255.0F);
    levels_.push_back({side, 1, std::move(texels)});
    while (levels_.back().side > 1) {
        const Level& fine = levels_.back();
        Level coarse{fine.side / 2, fine.scale / 2, {}};
        coarse.texels.reserve(fine.texels.size() / 4);
        for (int y = 0; y < fine.side; y += 2)
            for (int x = 0; x < fine.side; x += 2) {
                const float* row = &fine.texels[static_cast<size_t>(y) * fine.side + x];
                coarse.texels.push_back((row[0] + row[1] + row[fine.side] + row[fine.side + 1]) /
                                        4);
            }
        levels_.push_back(std::move(coarse));
    }
    ready_.store(true, std::memory_order_release);
}

double Texture::Level::bilinear(double x, double y) const {
    x = (x + 0.5) * scale - 0.5;
    y = (y + 0.5) * scale - 0.5;
    int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
    x0 -= x < x0;  // rounds down, much faster than std::floor without SSE 4.1
    y0 -= y < y0;
    const double a = x - x0, b = y - y0;
    const int mask = side - 1;
    const float* top = &texels[static_cast<size_t>(y0 & mask) * side];
    const float* bottom = &texels[static_cast<size_t>((y0 + 1) & mask) * side];
    const int left = x0 & mask, right = (x0 + 1) & mask;
    return (1 - b) * (top[left] + a * (top[right] - top[left])) +
           b * (bottom[left] + a * (bottom[right] - bottom[left]));
}

double Texture::sample(double u, double v, double footprint) const {
    if (!ready_.load(std::memory_order_acquire)) std::call_once(made_, [this] { make(); });
    const double x = u * inverse_texel_, y = v * inverse_texel_;
    const double texels = footprint * inverse_texel_;
    if (texels <= 1) return levels_[0].bilinear(x, y);
    const double level = std::min(std::log2(texels), static_cast<double>(levels_.size() - 1));
    const size_t fine = static_cast<size_t>(level);
    const double share = level - static_cast<double>(fine);
    if (share < 1e-3 || fine + 1 >= levels_.size()) return levels_[fine].bilinear(x, y);
    return (1 - share) * levels_[fine].bilinear(x, y) + share * levels_[fine + 1].bilinear(x, y);
}

}  // namespace vio
