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

// Adds gradient noise of `cells` lattice cells per period.
void add_gradient_noise(Torus& torus, std::uint64_t seed, int cells, double amplitude) {
    const int side = torus.side();
    const auto slope = [&](int cx, int cy, double dx, double dy) {
        const std::uint64_t h = mixed(seed ^ mixed((static_cast<std::uint64_t>(cy % cells) << 32) |
                                                   static_cast<std::uint64_t>(cx % cells)));
        const double angle = 2 * std::numbers::pi * static_cast<double>(h >> 11) * 0x1p-53;
        return std::cos(angle) * dx + std::sin(angle) * dy;
    };
    const auto fade = [](double s) { return s * s * s * (s * (6 * s - 15) + 10); };
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
            const double gx = static_cast<double>(x) * cells / side;
            const double gy = static_cast<double>(y) * cells / side;
            const int cx = static_cast<int>(gx), cy = static_cast<int>(gy);
            const double dx = gx - cx, dy = gy - cy;
            const double top =
                std::lerp(slope(cx, cy, dx, dy), slope(cx + 1, cy, dx - 1, dy), fade(dx));
            const double bottom = std::lerp(slope(cx, cy + 1, dx, dy - 1),
                                            slope(cx + 1, cy + 1, dx - 1, dy - 1), fade(dx));
            torus.at(x, y) += static_cast<float>(amplitude * std::lerp(top, bottom, fade(dy)));
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
    : seed_(seed), texel_(texel), side_(side) {}

const std::vector<Texture::Level>& Texture::levels() const {
    std::call_once(made_, [this] { make(); });
    return levels_;
}

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
    levels_.push_back({side, torus.take()});
    for (float& t : levels_[0].texels) t = std::clamp(t, 0.0F, 255.0F);
    while (levels_.back().side > 1) {
        const Level& fine = levels_.back();
        Level coarse{fine.side / 2, {}};
        coarse.texels.reserve(fine.texels.size() / 4);
        for (int y = 0; y < fine.side; y += 2)
            for (int x = 0; x < fine.side; x += 2) {
                const float* row = &fine.texels[static_cast<size_t>(y) * fine.side + x];
                coarse.texels.push_back((row[0] + row[1] + row[fine.side] + row[fine.side + 1]) /
                                        4);
            }
        levels_.push_back(std::move(coarse));
    }
}

double Texture::Level::bilinear(double x, double y) const {
    const double fx = std::floor(x), fy = std::floor(y);
    const auto wrap = [this](double f) {
        return static_cast<int>(static_cast<std::int64_t>(f) & (side - 1));
    };
    const int x0 = wrap(fx), y0 = wrap(fy), x1 = (x0 + 1) & (side - 1), y1 = (y0 + 1) & (side - 1);
    const double a = x - fx, b = y - fy;
    const float* top = &texels[static_cast<size_t>(y0) * side];
    const float* bottom = &texels[static_cast<size_t>(y1) * side];
    return (1 - b) * (top[x0] + a * (top[x1] - top[x0])) +
           b * (bottom[x0] + a * (bottom[x1] - bottom[x0]));
}

double Texture::sample(double u, double v, double footprint) const {
    const double x = u / texel_, y = v / texel_;
    const double texels = footprint / texel_;
    const std::vector<Level>& pyramid = levels();
    if (texels <= 1) return pyramid[0].bilinear(x, y);
    const double level = std::min(std::log2(texels), static_cast<double>(pyramid.size() - 1));
    const auto at_level = [&](size_t k) {
        const double scale = std::ldexp(1.0, -static_cast<int>(k));
        return pyramid[k].bilinear((x + 0.5) * scale - 0.5, (y + 0.5) * scale - 0.5);
    };
    const size_t fine = static_cast<size_t>(level);
    const double share = level - static_cast<double>(fine);
    if (share < 1e-3 || fine + 1 >= pyramid.size()) return at_level(fine);
    return (1 - share) * at_level(fine) + share * at_level(fine + 1);
}

}  // namespace vio
