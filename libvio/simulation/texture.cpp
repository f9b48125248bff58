#include "libvio/simulation/texture.h"

#include <algorithm>
#include <cmath>

namespace vio {
Texture::Texture(Material material, std::uint64_t seed, double texel, int side)
    : material_(material), seed_(seed), inverse_texel_(1 / texel), side_(side) {}

void Texture::make() const {
    std::vector<float> texels = material_texels(material_, seed_, side_);
    for (float& t : texels) t = std::clamp(t, 0.0F, 255.0F);
    levels_.push_back({side_, 1, std::move(texels)});
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
