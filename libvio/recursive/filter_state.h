// State of the recursive estimator: mean and covariance behind a few verbs.
//
// The state is a core (the moving IMU frame I), the camera's mount where that is uncertain, a
// window of cloned IMU poses when images were taken, and landmarks. Error order: core | mount |
// clones | landmarks. Every error is plain: rotations perturbed on the right, everything else added
// in its own frame. Images are seen from clones, so the time offset acts where these are made: a
// clone is where the core was or will be by the offset's error.
//
// Consistency. Global position and rotation about gravity cannot be observed. A filter that
// linearises at changing estimates gains spurious information about them. Here a correction acts as
// in the right-invariant filter (Barrau and Bonnabel 2017): the errors that stay the same while the
// mean moves are phi = R theta and, for every vector x of the world frame (position, velocity,
// gravity), dx - phi x x. In plain coordinates the covariance is therefore carried from the mean
// before a correction to the mean after it ("-" and "+") by
//   theta+ = R+^T R- theta-,   dx+ = dx- + skew(x- - x+) R- theta-
// where a clone's position goes with the clone's own rotation and everything else with the core's.
// The accelerometer's bias goes with attitude so that the error of the specific force at rest
// stays. Landmarks are anchored to clones (anchored_point.h): the unobservable directions do not
// touch their errors. This maps the unobservable directions at one mean exactly to those at the
// other.
//
// Scale is observed by accelerations alone, hence hardly while the motion is steady; images say
// nothing about it. So that their noise does not either, its direction n(x) (all positions, about
// the world's origin as for rotation, velocity, minus every inverse distance) is carried alike:
// what was travelled scales with what the next correction makes of it. The errors that a correction
// leaves are (I + (n(x+) - n(x-)) s^T) times those before, where s reads the common share of the
// landmarks' inverse distances, s^T n(x-) = 1. What the readings' noise had in n is taken out of it
// as the images correct it (errors_in_variables.h).
#pragma once

#include <Eigen/Dense>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "libvio/base/types.h"
#include "libvio/geometry/pose.h"
#include "libvio/recursive/anchored_point.h"
#include "libvio/recursive/core_state.h"
#include "libvio/recursive/errors_in_variables.h"

namespace vio {

/// The IMU's pose when an earlier image was taken.
struct ClonedPose {
    int image_idx = -1;  ///< of the image taken there; -1: the slot is free
    Pose T_W_I;
};

/// A point in the state, and how it fared lately (counts of images).
struct LandmarkState {
    FeatureId id = -1;
    int anchor = -1;  ///< slot of the clone that the point is seen from
    AnchoredPoint point;
    int observations = 0;
    int images_unseen = 0;  ///< consecutive, up to now
    int rejections = 0;     ///< consecutive, up to now
};

/// Linearised measurement of one landmark from a clone, scaled to unit noise: residual is the sum
/// of the Jacobians, each times its error (rotation and position of the clone and of the landmark's
/// anchor, T_I_C, the landmark's own), and noise.
struct PointRows {
    int landmark_idx = -1;
    int slot = -1;  ///< of the clone
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 6> J_pose, J_anchor;
    Eigen::Matrix<double, 2, 6> J_camera = Eigen::Matrix<double, 2, 6>::Zero();
    Matrix23d J_landmark;
};

/// Sums over updates of what they measured beyond what was expected.
struct InnovationSums {
    int dof = 0;            ///< rows
    double squared = 0;     ///< in variances of the measurement
    double normalised = 0;  ///< r^T S^-1 r
    double scale = 0;       ///< largest correction of scale, in its own standard deviations

    void add(const Eigen::Ref<const Eigen::VectorXd>& residual, double normalised_square) {
        dof += static_cast<int>(residual.size());
        squared += residual.squaredNorm();
        normalised += normalised_square;
    }
};

/// Mean and covariance; keeps the order of the errors and their frames to itself.
class FilterState {
 public:
    /// covariance: of the core.
    FilterState(CoreKind kind, const CoreState& mean, const CoreMatrix& covariance, bool invariant);

    // ---- What is believed --------------------------------------------------------------------

    int core_size() const { return core_size_; }
    /// Of the mount's errors; 0: it is known exactly.
    int mount_size() const { return mount_size_; }
    /// Core, mount and clones: columns that a measurement from the window can touch.
    int window_size() const { return clone_offset(static_cast<int>(clones_.size())); }
    int size() const { return size_; }
    const CoreState& core() const { return core_; }
    const CameraMount& mount() const { return mount_; }
    /// T_I_C where the errors are delta.
    Pose T_I_C(const Eigen::VectorXd& delta) const {
        return mount_size_ == 0 ? mount_.T_I_C
                                : mount_.T_I_C.boxplus(delta.segment<6>(mount_offset()));
    }
    const std::vector<ClonedPose>& clones() const { return clones_; }
    const std::vector<LandmarkState>& landmarks() const { return landmarks_; }
    int mount_offset() const { return core_size_; }
    int clone_offset(int slot) const { return core_size_ + mount_size_ + 6 * slot; }
    int landmark_offset(int idx) const { return window_size() + 3 * idx; }
    /// Slot of the clone made at an image; -1 if there is none.
    int find_clone(int image_idx) const;
    /// Covariance of the core, always current.
    CoreMatrix core_covariance() const { return P_.topLeftCorner(core_size_, core_size_); }
    /// Covariance of core and time offset, which follows it, likewise. Only with a mount.
    CoreMatrix timed_covariance() const;
    /// Whole covariance. Only after settle().
    auto covariance() const { return P_.topLeftCorner(size_, size_); }

    // ---- Verbs -------------------------------------------------------------------------------

    /// The core moves: new mean, transition and noise. Costs nothing for clones and landmarks.
    void propagate(const CoreState& mean, const CoreMatrix& transition, const CoreMatrix& noise);

    /// Iterated update with a measurement of the core alone. Its effect on clones and landmarks
    /// waits until settle() (compressed filter, Guivant and Nebot 2001).
    /// linearise gives residual and Jacobian at a core: residual = H dx + unit noise.
    using LineariseCore =
        std::function<void(const CoreState& core, CoreRows* H, CoreResidual* residual)>;
    void update_core(const LineariseCore& linearise, int iterations);

    /// Carries what the core did since the last call over to clones and landmarks.
    void settle();

    /// Linearises the measurement at the mean moved by delta; residuals at that mean, Jacobians
    /// with respect to the errors there.
    using Linearise = std::function<void(const Eigen::VectorXd& delta, std::vector<PointRows>*)>;

    /// Iterated update (Gelb 1974) with all landmarks seen in an image, Eq. (22). Returns the
    /// number of iterations; 0, and nothing is changed, where there are no rows or the residual's
    /// covariance is not positive definite.
    int update(const Linearise& linearise, int max_iterations);

    // Jacobians below have the last columns of the window: all, or those of mount and clones.

    /// Update with residual = H dx + unit noise. Nothing is changed where the residual's covariance
    /// is not positive definite.
    void update(const Eigen::MatrixXd& H, const Eigen::VectorXd& residual);

    /// Innovations of all updates since the last call, at the means before them.
    InnovationSums take_innovations() { return std::exchange(innovations_, {}); }

    /// Covariance of a linear function of the window, H P H^T.
    Eigen::MatrixXd projected_covariance(const Eigen::MatrixXd& H) const;

    /// Adds k landmarks whose errors are G dx + noise: Eqs. (24), (25). G: 3k rows. Their anchors
    /// are clones.
    void augment(const std::vector<LandmarkState>& landmarks, const Eigen::MatrixXd& G,
                 const Eigen::MatrixXd& noise);

    /// Adds the current pose to the window. pose_rate: how the pose's errors grow with that of the
    /// time offset (angular velocity [rad/s], velocity [m/s]); shift: from the core to the image
    /// [s].
    void clone(int image_idx, const Vector6d& pose_rate = Vector6d::Zero(), double shift = 0);
    /// Forgets the clone in a slot; no landmark may be anchored there.
    void release_clone(int slot);
    /// Anchors a landmark to the clone in another slot.
    void reanchor(int idx, int slot, const MovedPoint& moved);
    /// Forgets landmarks (marginalises them); remove[i] tells for landmark i.
    void marginalise(const std::vector<bool>& remove);

    /// Makes the core, and the clone in a slot with it, less certain, by standard deviations [rad],
    /// [m], [m/s].
    void inflate(int slot, double rotation, double position, double velocity);

    LandmarkState& landmark(int idx) { return landmarks_[idx]; }

    // ---- For models --------------------------------------------------------------------------

    /// Mean moved by an error vector (first entries of delta; the rest stays).
    static CoreState moved(const CoreState& core, const Eigen::Ref<const Eigen::VectorXd>& delta);

    /// The camera's mount; covariance: empty where it is exact, else of kMountSize. Before the
    /// first clone.
    void start_mount(const CameraMount& mount, const Eigen::MatrixXd& covariance);
    /// Start with a given joint covariance of core, mount, clones and landmarks.
    void start_landmarks(const std::vector<LandmarkState>& landmarks,
                         const Eigen::MatrixXd& joint_covariance);

 private:
    static double bias_follows_attitude(const CoreState& core,
                                        const Eigen::Ref<const Eigen::VectorXd>& delta);
    Eigen::Block<Eigen::MatrixXd> P() { return P_.topLeftCorner(size_, size_); }
    void reserve(int size);
    void fill_upper(int at, int count);
    void combine(const Eigen::Ref<const Eigen::MatrixXd>& M, const PointRows& row, double* first,
                 double* second) const;
    void project(const PointRows& row, int column);
    void gain(const std::vector<PointRows>& rows);
    void gain(const Eigen::MatrixXd& H);
    Eigen::VectorXd covariance_with(const Eigen::VectorXd& reading) const;
    bool change_gain(const Eigen::VectorXd& u, const Eigen::VectorXd& reading);
    Eigen::VectorXd weighted(Eigen::VectorXd residual) const;
    Eigen::Vector2d applied(const PointRows& row, const Eigen::VectorXd& d) const;
    Eigen::VectorXd applied(const std::vector<PointRows>& rows, const Eigen::VectorXd& d) const;
    void carry_back(const Eigen::VectorXd& delta, std::vector<PointRows>* rows) const;
    bool linear_until(const Linearise& linearise, const std::vector<PointRows>& rows,
                      const Eigen::VectorXd& residual, const Eigen::VectorXd& delta,
                      const Eigen::VectorXd& reading) const;
    void reduce_covariance(const std::vector<PointRows>& rows, const Eigen::VectorXd& reading);
    void reduce_covariance();
    Eigen::MatrixXd times_transpose(const Eigen::Ref<const Eigen::MatrixXd>& M,
                                    const std::vector<PointRows>& rows) const;
    Eigen::MatrixXd times_transpose(const Eigen::Ref<const Eigen::MatrixXd>& M,
                                    const Eigen::MatrixXd& H) const;
    Eigen::VectorXd transposed_times(const std::vector<PointRows>& rows, const Eigen::VectorXd& w,
                                     Eigen::Index size) const;
    Eigen::VectorXd transposed_times(const Eigen::MatrixXd& H, const Eigen::VectorXd& w,
                                     Eigen::Index size) const;
    template <typename Rows>
    Eigen::VectorXd sensitivity_change(const Rows& H, const Eigen::VectorXd& weight) const;
    bool trusts_sensitivity() const;
    template <typename Rows>
    void update_sensitivity(const Rows& H, bool trusted);
    template <typename Rows>
    void take_out_noise(const Rows& H);
    // s^2, I and, where it is due, n of errors_in_variables.h.
    struct ToldOfScale {
        double variance = 0, information = 0;
        std::optional<double> noise;
        double sigmas(double correction) const;
    };
    ToldOfScale told_of_scale(const std::vector<PointRows>& rows,
                              const Eigen::VectorXd& reading) const;
    void doubt_scale(const ToldOfScale& told, const Eigen::VectorXd& reading,
                     Eigen::VectorXd* delta);
    void correct(const Eigen::VectorXd& delta, const Eigen::VectorXd& from_noise = {});
    void carry(int at, const Carrier& T);
    Eigen::VectorXd scale_direction(const Eigen::VectorXd& delta) const;
    Eigen::VectorXd scale_reading() const;
    ErrorsInVariables::Scale scale() const;
    Eigen::VectorXd scaled(Eigen::VectorXd delta, const Eigen::VectorXd& reading) const;
    void carry_scale(const Eigen::VectorXd& change, const Eigen::VectorXd& reading);
    Matrix6d pose_carrier(const Vector6d& delta, const Eigen::Matrix3d& R_before) const;
    CoreMatrix core_carrier(const Eigen::Ref<const Eigen::VectorXd>& delta, const CoreState& before,
                            const CoreState& after) const;

    int core_size_, mount_size_ = 0, size_;
    bool invariant_;
    CoreState core_;
    CameraMount mount_;
    std::vector<ClonedPose> clones_;
    std::vector<LandmarkState> landmarks_;
    Eigen::MatrixXd P_;  // capacity; the covariance is its top left corner

    // What waits for clones and landmarks r since settle(), in terms of P_cr then:
    // P_cr = transition P_cr,  P_rr -= P_rc information P_cr,  x_r += P_rc vector.
    struct {
        bool any = false, measured = false;
        CoreMatrix transition, information;
        CoreVector vector;
    } waiting_;

    std::optional<ErrorsInVariables> in_variables_;
    InnovationSums innovations_;

    // Work space of updates. H has rows J + u s^T (u empty: J), where s reads the scale's error.
    Eigen::MatrixXd PHt_;            // P H^T, then W = P H^T L^-T
    Eigen::MatrixXd HP_;             // its transpose
    Eigen::MatrixXd L_;              // innovation covariance S, then its factor, lower triangle
    Eigen::VectorXd u_, P_reading_;  // P s
};

}  // namespace vio
