#include "libvio/tracking/patch.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace vio {
namespace {

constexpr int kMaxIterations = 8;
constexpr double kConverged_px = 0.01;
constexpr double kLargestWalk_px = 3;   // further from the start than this is another feature
constexpr double kWeakestGradient = 4;  // rms gradient [grey/px] along the weak direction
constexpr double kLargestAxisRatio = 4;
// Weight of staying with the affine shape of the previous image, relative to the texture: the shape
// changes slowly, and a free shape lets noise in.
constexpr double kShapeInertia = 3;
constexpr float kWeakestMatch = 0.7F;  // correlation at half size
constexpr float kLeastLead = 0.1F;     // of the best place over any other

// Bilinear samples at uv + A (i, j), row by row. False if any lies outside the image.
bool sample(const cv::Mat& image, const Eigen::Vector2d& uv, const Eigen::Matrix2d& A, int half,
            float* out) {
    const Eigen::Vector2d reach = half * A.cwiseAbs().rowwise().sum();
    if (!(uv.x() - reach.x() >= 0 && uv.y() - reach.y() >= 0 &&
          uv.x() + reach.x() < image.cols - 1 && uv.y() + reach.y() < image.rows - 1))
        return false;
    const auto a = A.cast<float>().eval();
    const auto centre = uv.cast<float>().eval();
    const auto stride = static_cast<std::ptrdiff_t>(image.step);
    for (int j = -half; j <= half; ++j)
        for (int i = -half; i <= half; ++i) {
            const auto fi = static_cast<float>(i), fj = static_cast<float>(j);
            const float x = centre.x() + a(0, 0) * fi + a(0, 1) * fj;
            const float y = centre.y() + a(1, 0) * fi + a(1, 1) * fj;
            const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
            const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
            const unsigned char* p = image.data + y0 * stride + x0;
            const float top = static_cast<float>(p[0]) + fx * static_cast<float>(p[1] - p[0]);
            const float bottom =
                static_cast<float>(p[stride]) + fx * static_cast<float>(p[stride + 1] - p[stride]);
            *out++ = top + fy * (bottom - top);
        }
    return true;
}

float weight(int i, int j) {  // Gaussian window
    constexpr float kSigma = 0.6F * Patch::kHalf;
    return std::exp(-0.5F * static_cast<float>(i * i + j * j) / (kSigma * kSigma));
}

const Eigen::Matrix<float, Patch::kPixels, 1>& root_weights() {
    static const auto weights = [] {
        Eigen::Matrix<float, Patch::kPixels, 1> w;
        int k = 0;
        for (int j = -Patch::kHalf; j <= Patch::kHalf; ++j)
            for (int i = -Patch::kHalf; i <= Patch::kHalf; ++i) w[k++] = std::sqrt(weight(i, j));
        return w;
    }();
    return weights;
}

// To zero mean and unit norm.
template <typename Values>
void normalise(Values& values) {
    values.array() -= values.mean();
    values /= std::max(1e-6F, values.norm());
}

}  // namespace

std::optional<Patch> Patch::cut(const cv::Mat& image, const Eigen::Vector2d& uv_px) {
    constexpr int kWide = kSide + 2;
    float values[kWide * kWide];
    if (!sample(image, uv_px, Eigen::Matrix2d::Identity(), kHalf + 1, values)) return std::nullopt;
    Patch patch;
    int k = 0;
    for (int j = -kHalf; j <= kHalf; ++j)
        for (int i = -kHalf; i <= kHalf; ++i, ++k) {
            const float* v = values + (j + kHalf + 1) * kWide + (i + kHalf + 1);
            const float gx = 0.5F * (v[1] - v[-1]), gy = 0.5F * (v[kWide] - v[-kWide]);
            const float x = static_cast<float>(i) / kHalf, y = static_cast<float>(j) / kHalf;
            patch.J_.row(k) << gx * x, gx * y, gy * x, gy * y, gx, gy, v[0], 1;
        }
    // As the pyramid makes its levels, but with the binomial window 1 2 1.
    k = 0;
    for (int j = -2 * kCoarseHalf; j <= 2 * kCoarseHalf; j += 2)
        for (int i = -2 * kCoarseHalf; i <= 2 * kCoarseHalf; i += 2, ++k) {
            const float* v = values + (j + kHalf + 1) * kWide + (i + kHalf + 1);
            const float sides = v[-1] + v[1] + v[-kWide] + v[kWide];
            const float corners = v[-kWide - 1] + v[-kWide + 1] + v[kWide - 1] + v[kWide + 1];
            patch.coarse_[k] = 4 * v[0] + 2 * sides + corners;
        }
    normalise(patch.coarse_);
    patch.J_.array().colwise() *= root_weights().array();
    Eigen::Matrix<double, kColumns, kColumns> normal =
        (patch.J_.transpose() * patch.J_).cast<double>();
    patch.structure_ = normal.block<2, 2>(kShift, kShift);
    const double total_weight = normal(kOffset, kOffset);
    const double weakest =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(patch.structure_).eigenvalues()[0];
    if (!(weakest > kWeakestGradient * kWeakestGradient * total_weight)) return std::nullopt;
    normal.diagonal().head<4>() *= 1 + kShapeInertia;
    const Eigen::LDLT<Eigen::Matrix<double, kColumns, kColumns>> factor(normal);
    patch.normal_inverse_.setIdentity();
    factor.solveInPlace(patch.normal_inverse_);
    if (!patch.normal_inverse_.allFinite()) return std::nullopt;
    return patch;
}

// Linear in (gain * warp increment, gain, offset):  I(W) ~ J (gain * dp) + gain T + offset.
std::optional<Patch::Alignment> Patch::align(const cv::Mat& image, const Eigen::Vector2d& uv_px,
                                             const Eigen::Matrix2d& A) const {
    Alignment result{uv_px, A, -1};
    Values seen;
    for (int iteration = 0;; ++iteration) {
        if (!sample(image, result.uv_px, result.A, kHalf, seen.data())) return std::nullopt;
        seen.array() *= root_weights().array();
        const Eigen::Matrix<double, kColumns, 1> b = (J_.transpose() * seen).cast<double>();
        const Eigen::Matrix<double, kColumns, 1> q = normal_inverse_ * b;
        const double gain = q[kGain];
        if (!(gain > 0.05)) return std::nullopt;
        const Eigen::Vector2d shift = q.segment<2>(kShift) / gain;
        Eigen::Matrix2d shape;
        shape << q[0], q[1], q[2], q[3];
        shape = Eigen::Matrix2d::Identity() + shape / (gain * kHalf);
        // I(W(x)) = T(x + shape x + shift): the increment is undone on the side of the patch.
        const double determinant = shape.determinant();
        if (!(determinant > 0.3 && determinant < 3)) return std::nullopt;
        const Eigen::Matrix2d undo = shape.inverse();
        const Eigen::Vector2d step = -result.A * (undo * shift);
        result.uv_px += step;
        result.A = result.A * undo;
        if (!((result.uv_px - uv_px).norm() < kLargestWalk_px)) return std::nullopt;
        if (step.norm() < kConverged_px || iteration + 1 == kMaxIterations) {
            const double n = J_.col(kOffset).squaredNorm();
            const double mean_seen = b[kOffset] / n;
            const double mean_patch = J_.col(kOffset).dot(J_.col(kGain)) / n;
            const double var_seen = seen.squaredNorm() / n - mean_seen * mean_seen;
            const double var_patch = J_.col(kGain).squaredNorm() / n - mean_patch * mean_patch;
            const double product = b[kGain] / n - mean_seen * mean_patch;
            result.correlation = product / std::sqrt(std::max(1e-6, var_seen * var_patch));
            return result;
        }
    }
}

std::optional<Eigen::Vector2d> Patch::search(const cv::Mat& half, const Eigen::Vector2d& uv_px,
                                             const Eigen::Matrix2d& A,
                                             const Eigen::Matrix2d& region) const {
    const Eigen::Matrix2d information = region.inverse();
    const int reach_x = static_cast<int>(1.5 * std::sqrt(region(0, 0)));
    const int reach_y = static_cast<int>(1.5 * std::sqrt(region(1, 1)));
    struct Candidate {
        float correlation;
        Eigen::Vector2d step;
    };
    std::vector<Candidate> candidates;
    CoarseValues seen;
    for (int y = -reach_y; y <= reach_y; ++y)
        for (int x = -reach_x; x <= reach_x; ++x) {
            const Eigen::Vector2d step(2 * x, 2 * y);
            if (step.dot(information * step) > 9) continue;
            if (!sample(half, 0.5 * (uv_px + step), A, kCoarseHalf, seen.data())) continue;
            normalise(seen);
            candidates.push_back({seen.dot(coarse_), step});
        }
    const auto best = std::max_element(
        candidates.begin(), candidates.end(),
        [](const Candidate& a, const Candidate& b) { return a.correlation < b.correlation; });
    if (best == candidates.end() || best->correlation < kWeakestMatch) return std::nullopt;
    for (const Candidate& other : candidates)
        if ((other.step - best->step).norm() > kHalf &&
            other.correlation > best->correlation - kLeastLead)
            return std::nullopt;
    return uv_px + best->step;
}

Eigen::Matrix2d covariance_shape(const Eigen::Matrix2d& structure_tensor,
                                 const Eigen::Matrix2d& A) {
    const Eigen::Matrix2d covariance = A * structure_tensor.inverse() * A.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(covariance);
    const double ratio = std::sqrt(std::min(eigen.eigenvalues()[1] / eigen.eigenvalues()[0],
                                            kLargestAxisRatio * kLargestAxisRatio));
    return eigen.eigenvectors() * Eigen::Vector2d(1 / ratio, ratio).asDiagonal() *
           eigen.eigenvectors().transpose();
}

}  // namespace vio
