// Rendered images of an AprilGrid before a mirror.
#pragma once

#include <vector>

#include "tests/board_images.h"
#include "tests/mirror_camera.h"

namespace vio::test {

/// A board of 5 x 4 tags of 88 mm, held somewhere 0.35 m before a misaligned mirror.
class MirrorBoard {
 public:
    explicit MirrorBoard(std::uint64_t seed)
        : random_(seed, "board before a mirror"),
          T_C_M_(misaligned_mirror(random_)),
          camera_(mirror_camera(T_C_M_)),
          renderer_(*camera_, pattern_, 2),
          board_(
              make_april_grid(pattern_.cols, pattern_.rows, pattern_.tag_size, pattern_.spacing)) {}

    struct Shot {
        cv::Mat image;
        Pose T_C_G;
    };
    /// The next image, from another side each time.
    Shot shoot() {
        constexpr double kDistance = 0.35;
        const Eigen::Vector3d middle(2.5 * 1.3 * 0.088, 2 * 1.3 * 0.088, 0);
        std::optional<Ray> ray;
        while (!ray) ray = camera_->ray({640 * random_.uniform(), 480 * random_.uniform()});
        const Eigen::Matrix3d R =
            Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), -ray->direction)
                .toRotationMatrix() *
            so3::exp({0.4 * random_.normal(), 0.4 * random_.normal(), 3 * random_.normal()});
        const Pose T_C_G{R, ray->origin + kDistance * ray->direction - R * middle};
        return {renderer_.image(T_C_G.inverse(), ++shots_), T_C_G};
    }

    const Pose& T_C_M() const { return T_C_M_; }
    const MirrorCamera& camera() const { return *camera_; }
    const Board& board() const { return board_; }

 private:
    Random random_;
    Pose T_C_M_;
    std::shared_ptr<const MirrorCamera> camera_;
    AprilGridPattern pattern_;
    BoardRenderer renderer_;
    Board board_;
    std::uint64_t shots_ = 0;
};

}  // namespace vio::test
