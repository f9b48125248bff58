// The error function, Eq. (1): E = E_image + E_inertial + E_prior, its value and derivatives.
#pragma once

#include <memory>
#include <vector>

#include "libvio/batch/model.h"
#include "libvio/batch/normal_equations.h"
#include "libvio/batch/robust_loss.h"

namespace vio::batch {

/// Value by term; every term is a sum of squared Mahalanobis distances (after the robust loss).
struct Cost {
    double image = 0, inertial = 0, prior = 0;
    double total() const { return image + inertial + prior; }
};

/// What of the options may change from one stage of the minimisation to the next.
struct Stage {
    bool gravity_free = false;  ///< estimate its norm too
    std::string loss = "none";
    /// Observations that are off by more than the image's diagonal, or out of sight, cost that much
    /// and exert no pull: far from the solution they would pull anywhere.
    bool truncated = false;
    /// The normal equations are the information that measurements give, for covariances, not the
    /// model of the cost that leads to its minimum; see robust_loss.h.
    bool information = false;
};

/// Parts of the rig that are unknown too, in this order: T_I_C (6, in the pose's tangent order),
/// the time offset (1), intrinsics (see camera/intrinsics.h).
struct RigUnknowns {
    bool extrinsics = false, time_offset = false;
    int intrinsics = 0;  ///< how many

    int count() const { return (extrinsics ? 6 : 0) + (time_offset ? 1 : 0) + intrinsics; }
};

/// (gyro, accel).
inline Vector6d bias_vector(const ImuBias& bias) {
    Vector6d v;
    v << bias.gyro, bias.accel;
    return v;
}

/// A sight line when its end moves by d: linearly in the direction and in the inverse range (Civera
/// et al. 2008), which images are nearly linear in even where a small angle leads to infinity.
Eigen::Vector3d displaced(const Eigen::Vector3d& line, const Eigen::Vector3d& d);

/// Whether a point's normal equations leave a direction open, to working accuracy.
bool undetermined(const Eigen::Matrix3d& V);

/// The error function of a model, for one stage of the estimate.
class Objective {
 public:
    Objective(const Model& model, const BatchOptions& options, const Stage& stage);

    /// Threads that evaluate() and linearize() use; results do not depend on it.
    int threads() const { return threads_; }

    /// Whether gravity's norm is estimated too.
    bool gravity_free() const { return stage_.gravity_free; }

    /// Cost at a state. Readings are integrated at the biases of the last linearisation and
    /// corrected to first order.
    Cost evaluate(const State& state) const;

    /// Integrates the readings anew where the state's biases have moved away from those of the last
    /// integration, fills the normal equations (IRLS weights for robust losses), returns the cost.
    Cost linearize(const State& state, NormalEquations& equations);

    /// The border of the normal equations for unknowns of the rig, at the state of the last
    /// linearisation.
    Border linearize_rig(const State& state, const RigUnknowns& unknowns,
                         const NormalEquations& equations) const;

    /// Integrates the readings anew, at the biases of the last time: after the model's time offset
    /// has changed. (The camera and its place may change at any time.)
    void readings_changed();

    /// next = state [+] step. Points are displaced() as seen from the first camera that saw them,
    /// which their images constrain.
    void apply(const State& state, const Step& step, const Layout& layout, State& next) const;

    /// Moves the points of `state`, a step away from `from` (the state last linearised at), to
    /// where their own images want them with the cameras as they are; each starts from where the
    /// step or its first camera takes it. Points with hardly any parallax follow no linear model,
    /// and few of them would hold up the step of all. Fiducials stay, and everything does while the
    /// stage is truncated: what images want says nothing yet.
    /// Returns the cost then, as evaluate() does.
    Cost settle_points(const State& from, State& state) const;

    /// Moves an image's pose to where the points that `observations` (of this image, by index) see
    /// want it, these as they are. It stays where fewer than four are given.
    void settle_pose(int frame, const std::vector<int>& observations, State& state) const;

    /// Derivative of g_W wrt its unknowns: two rotations about axes across it when its norm is
    /// fixed (third column zero), the identity when it is free.
    Eigen::Matrix3d gravity_jacobian(const Eigen::Vector3d& gravity) const;

    /// Residual of one observation in pixels, nothing where the point cannot be seen.
    std::optional<Eigen::Vector2d> image_residual(const State& state,
                                                  const Observation& observation) const;

    /// Of the information that readings seem to give of scale, what is their noise: m of
    /// scale_noise.h. `equations`: linearised at `state`, factorised.
    double noise_in_scale(const State& state, const NormalEquations& equations,
                          const Eigen::VectorXd& c) const;

    /// Whitened squared distance of one observation. A point that the camera cannot image in a
    /// trial state (behind it, beyond its field of view) counts, and is drawn back, by the angle
    /// between it and its sight line: the chord of the two on the unit sphere, at a pixel's angular
    /// size.
    double observation_distance2(const State& state, const Observation& observation) const;
    /// After the robust loss.
    double observation_cost(const State& state, const Observation& observation) const {
        return loss_.cost(observation_distance2(state, observation));
    }

 private:
    // Readings between two images, integrated; weight of what they say of the two.
    struct Interval {
        PreintegratedImu readings;
        Matrix9d sqrt_information;
        ImuBias bias;  // that it was integrated with
    };

    // What the observations of some points add to the poses of frames first, first + 1, ....
    struct PoseSums {
        int first = 0;
        std::vector<Matrix6d> H;
        std::vector<Vector6d> g;
        double cost = 0;
    };
    Interval make_interval(int i, const ImuBias& bias) const;
    // Of the cost: what is worth a further step of one point or pose.
    double worth() const { return 1e-2 * loss_.weight(0); }
    double image_weight(double distance2) const {
        return (stage_.information ? loss_.information() : 1) * loss_.weight(distance2);
    }
    void reintegrate(const State& state);
    double interval_cost(const State& state, int i) const;
    Eigen::Vector3d moved_point(const State& state, const State& next, const Step& step,
                                const Layout& layout, int point_idx) const;
    double linearize_image(const State& state, NormalEquations& equations);
    // Calls use(r, J) with an observation's residual and its derivative wrt p_C, whitened, of two
    // or three components; false where it exerts no pull.
    template <typename Use>
    bool with_residual(const State& state, const Observation& observation, Use use) const;
    // Normal equations of a point alone.
    struct PointSums {
        Eigen::Matrix3d V = Eigen::Matrix3d::Zero();
        Eigen::Vector3d b = Eigen::Vector3d::Zero();
        double cost = 0;
    };
    PointSums point_sums(const State& state, int point_idx) const;
    // Of a pose alone.
    struct OnePose {
        Matrix6d H = Matrix6d::Zero();
        Vector6d g = Vector6d::Zero();
        double cost = 0;
    };
    OnePose one_pose(const State& state, const std::vector<int>& observations) const;
    // Both return what it costs then.
    double settle_point(int point_idx, State& state) const;
    double settle_point(int point_idx, const State& from, State& state) const;
    Cost evaluate_rest(const State& state) const;  // all but the images' part
    // Adds one observation with N residual components: residual and derivative wrt p_C, whitened.
    template <int N>
    void add_observation(const State& state, int observation_idx,
                         const Eigen::Matrix<double, N, 1>& r,
                         const Eigen::Matrix<double, N, 3>& J_C, NormalEquations& equations,
                         PoseSums& sums) const;
    void linearize_observation(const State& state, int observation_idx, NormalEquations& equations,
                               PoseSums& sums) const;
    Eigen::Vector3d unseen_residual(const Eigen::Vector3d& p_C, const Observation& observation,
                                    Eigen::Matrix3d* J) const;
    // What the readings between images i and i + 1 say of the two, whitened. Columns: pose i,
    // velocity i, bias, pose j, velocity j, gravity.
    struct IntervalRows {
        Vector9d r;
        Eigen::Matrix<double, 9, 27> J;
    };
    IntervalRows interval_rows(const State& state, int i,
                               const Eigen::Matrix3d& gravity_jacobian) const;
    double linearize_inertial(const State& state, NormalEquations& equations) const;
    double linearize_interval(const State& state, int i, const Eigen::Matrix3d& gravity_jacobian,
                              NormalEquations& equations, Eigen::Matrix<double, 9, 9>& global_H,
                              Eigen::Matrix<double, 9, 1>& global_g) const;
    double linearize_bias(const State& state, NormalEquations& equations) const;
    double linearize_priors(const State& state, NormalEquations& equations) const;
    void add_rig_image(const State& state, const RigUnknowns& unknowns,
                       const NormalEquations& equations, Border& border) const;
    void add_time_offset(const State& state, int column, const NormalEquations& equations,
                         Border& border) const;
    void hold_scale(const State& state, NormalEquations& equations) const;
    double prior_weight() const;
    Vector6d bias_walk_information(int i) const;
    Eigen::Matrix3d fiducial_information(const Fiducial& fiducial) const;

    const Model& model_;
    BatchOptions options_;
    Stage stage_;
    RobustLoss loss_;
    int threads_;
    bool surveyed_;
    double largest_distance2_;  ///< that an observation can have; infinite unless truncated
    std::vector<Interval> intervals_;
    std::vector<double> point_costs_;  // at the last linearisation
    std::vector<PoseSums> pose_sums_;  // of each piece of the points
};

}  // namespace vio::batch
