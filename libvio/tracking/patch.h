// The look of a feature where it was first seen, and its alignment with a later image.
#pragma once

#include <Eigen/Dense>
#include <opencv2/core.hpp>
#include <optional>

namespace vio {

/// A square of grey values around a feature, with what is needed to find it again under an affine
/// change of shape and a change of gain and offset of brightness.
class Patch {
 public:
    static constexpr int kHalf = 7, kSide = 2 * kHalf + 1, kPixels = kSide * kSide;

    /// Where and in what shape the patch was found in an image.
    struct Alignment {
        Eigen::Vector2d uv_px;  ///< centre of the patch in the image
        Eigen::Matrix2d A;      ///< offsets in the patch to offsets in the image [-]
        double correlation;     ///< of grey values, -1 to 1
    };

    /// Cuts the patch centred at uv_px (8-bit grey image). Nothing if it crosses the image border
    /// or has too little texture to be located.
    static std::optional<Patch> cut(const cv::Mat& image, const Eigen::Vector2d& uv_px);

    /// Aligns the patch with the image, starting at uv_px and A: inverse-compositional Gauss-Newton
    /// over affine warp, gain and offset. Nothing if the patch crosses the image border or the
    /// iteration runs away.
    /// Source: S. Baker and I. Matthews, Lucas-Kanade 20 years on, IJCV 56(3), 2004.
    std::optional<Alignment> align(const cv::Mat& image, const Eigen::Vector2d& uv_px,
                                   const Eigen::Matrix2d& A) const;

    /// Where the patch is in the image of half size (pixel (x, y) there is (2x, 2y) in the image),
    /// to about a pixel: the place of best normalised correlation among the pixels of that image
    /// whose distance d to uv_px, in the image, has d^T region^-1 d <= 9. Nothing if the best place
    /// correlates badly or another one almost as well.
    std::optional<Eigen::Vector2d> search(const cv::Mat& half, const Eigen::Vector2d& uv_px,
                                          const Eigen::Matrix2d& A,
                                          const Eigen::Matrix2d& region) const;

    /// Sum of the outer products of the grey-value gradient over the patch.
    const Eigen::Matrix2d& structure_tensor() const { return structure_; }

 private:
    using Values = Eigen::Matrix<float, kPixels, 1>;
    enum Column { kAffine = 0, kShift = 4, kGain = 6, kOffset = 7, kColumns = 8 };

    Eigen::Matrix<float, kPixels, kColumns> J_;  ///< weighted derivatives; column kGain: the values
    Eigen::Matrix<double, kColumns, kColumns> normal_inverse_;
    Eigen::Matrix2d structure_;
    static constexpr int kCoarseHalf = 3, kCoarseSide = 2 * kCoarseHalf + 1;
    using CoarseValues = Eigen::Matrix<float, kCoarseSide * kCoarseSide, 1>;
    CoarseValues coarse_;  ///< at half size; zero mean, unit norm
};

/// Shape of the measurement covariance that texture with this structure tensor gives after the
/// warp A: the inverse of the tensor, scaled to unit determinant, so that isotropic texture gives
/// the identity; the ratio of its axes is limited to 4.
Eigen::Matrix2d covariance_shape(const Eigen::Matrix2d& structure_tensor, const Eigen::Matrix2d& A);

}  // namespace vio
