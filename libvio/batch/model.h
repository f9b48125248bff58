// The batch problem indexed for the solver: what is unknown, what was measured.
#pragma once

#include <vector>

#include "libvio/batch/batch.h"
#include "libvio/imu/preintegration.h"

namespace vio::batch {

/// One image measurement; observations of a point stand together, in order of time.
struct Observation {
    int frame_idx, point_idx;
    Eigen::Vector2d uv_px;
    Eigen::Matrix2d sqrt_information;  ///< whitens a pixel residual
    bool active = true;                ///< false once judged an outlier
};

/// A feature whose position is unknown (or given, as a fiducial), and its observations.
struct Point {
    FeatureId id;
    int first_observation, observation_count;
    const Fiducial* fiducial = nullptr;
};

/// Everything that does not change during the minimisation.
struct Model {
    CameraPtr camera;
    Pose T_I_C, T_C_I, T_I_B;
    ImuNoise noise;
    bool inertial = false;
    std::vector<TimeNs> times;                      ///< of the images, camera clock
    std::vector<std::vector<ImuSegment>> segments;  ///< [i]: readings from image i to i + 1
    std::vector<ImuNoise> interval_noise;           ///< [i]: theirs, gaps between readings included
    std::vector<Eigen::Vector3d> gyro_at_image;     ///< measured [rad/s]
    std::vector<Eigen::Vector3d> accel_at_image;    ///< measured [m/s^2]
    std::vector<Point> points;
    std::vector<Observation> observations;

    int frames() const { return static_cast<int>(times.size()); }
    bool surveyed() const;  ///< whether any point is a fiducial (W is then the survey's frame)
};

/// What an image-only estimate can use: without the images that see fewer than four points that
/// other images see too.
BatchProblem without_unseeing_images(const BatchProblem& problem);

/// Without the images that may lie outside the readings if the time offset errs by three of its
/// standard deviations [s].
BatchProblem without_images_at_ends(const BatchProblem& problem, double time_offset_sigma);

/// Indexes the first frame_count frames. Points seen fewer than min_observations times are left out
/// (fiducials are always kept). Throws InputError as estimate_batch() does.
Model make_model(const BatchProblem& problem, const BatchOptions& options, int frame_count,
                 int min_observations = 3);

/// Gives the model another rig than it was made with; what was observed stays.
void set_rig(Model& model, const BatchProblem& problem, const Rig& rig);
/// The same where time offset and IMU are those that it was made with.
void set_camera(Model& model, const Rig& rig);

/// The unknowns.
struct State {
    /// The unknowns of one image: T_W_I, velocity in W, biases in I.
    struct Frame {
        InertialState motion;  ///< of the IMU frame (of the body when image-only)
        ImuBias bias;          ///< equal in all frames when the bias is constant
    };
    std::vector<Frame> frames;
    std::vector<Eigen::Vector3d> points;  ///< p_W
    Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
};

/// Where each unknown stands in the reduced system: for each frame its pose (6), then its velocity
/// and random-walk biases (3 or 9); then points kept in the border (3 each), then the global block
/// (gravity 3, constant biases 6).
struct Layout {
    bool inertial = false, bias_per_frame = false;
    int frames = 0;
    std::vector<int> border_of_point;  ///< border slot, or -1: eliminated
    int border_points = 0;

    int blocks_per_frame() const { return inertial ? 2 : 1; }
    int pose_block(int frame) const { return frame * blocks_per_frame(); }
    int motion_block(int frame) const { return pose_block(frame) + 1; }
    int border_block(int slot) const { return frames * blocks_per_frame() + slot; }
    int global_block() const { return frames * blocks_per_frame() + border_points; }
    int motion_dim() const { return bias_per_frame ? 9 : 3; }
    int global_dim() const { return bias_per_frame ? 3 : 9; }
    std::vector<int> block_dims() const;

    /// Scalar index of component c (StateIndex order, 0..14) of a frame's error; -1 if not unknown.
    int index(int frame, int component) const;
    /// Scalar index of gravity's first component; -1 without inertial terms.
    int gravity_index() const;

 private:
    int frame_dim() const { return 6 + (inertial ? motion_dim() : 0); }
    int global_index() const { return frames * frame_dim() + 3 * border_points; }
};

/// Threads to use: as the options say, at most what the processor has.
int thread_count(const BatchOptions& options);

/// Points seen in more images than this are kept in the border: eliminating them would make the
/// reduced system dense.
Layout make_layout(const Model& model, const BatchOptions& options);

}  // namespace vio::batch
