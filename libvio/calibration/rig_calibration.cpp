#include "libvio/calibration/rig_calibration.h"

#include <cmath>
#include <limits>
#include <utility>

#include "libvio/base/errors.h"
#include "libvio/batch/minimize.h"
#include "libvio/batch/start.h"

namespace vio {

using namespace batch;

namespace {

class Calibrator {
 public:
    Calibrator(const BatchProblem& problem, const BatchOptions& options,
               const RigQuestion& question, const Estimate& start)
        : options_(options),
          unknowns_{question.extrinsics, question.time_offset, question.intrinsics},
          model_(
              make_model(problem, options, static_cast<int>(problem.frames.size()), kFewestImages)),
          state_(given_start(model_, start)),
          rig_(problem, model_, unknowns_,
               Eigen::VectorXd::Constant(unknowns_.count(),
                                         std::numeric_limits<double>::infinity())),
          equations_(model_, make_layout(model_, options), thread_count(options)) {
        if (model_.inertial && options.gravity == "magnitude")
            state_.gravity *= options.gravity_norm / state_.gravity.norm();
    }

    void set_sigma(double sigma_px) {
        const double factor = options_.sigma_px / sigma_px;
        for (Observation& observation : model_.observations) observation.sqrt_information *= factor;
        options_.sigma_px = sigma_px;
    }

    void minimize(const std::string& loss) {
        stage_ = {options_.gravity == "free", loss};
        Objective objective(model_, options_, stage_);
        constexpr double kDamping = 1e-6;  // far from the solution
        const MinimizeReport report = batch::minimize(
            objective, equations_, {options_.max_iterations, options_.cost_tolerance, kDamping},
            state_, &rig_);
        result.iterations += report.iterations;
        result.converged = report.converged;
        result.reason = report.reason;
    }

    // True if there are any new ones.
    bool drop_outliers() {
        const double limit2 = options_.outlier_sigmas * options_.outlier_sigmas;
        if (limit2 == 0) return false;
        const Objective objective(model_, options_, {});
        bool any = false;
        for (Observation& observation : model_.observations) {
            if (!observation.active ||
                objective.observation_distance2(state_, observation) <= limit2)
                continue;
            observation.active = false;
            any = true;
        }
        return any;
    }

    // Of one coordinate, over what is no outlier.
    double rms_px() const {
        const Objective objective(model_, options_, {});
        double sum = 0;
        int count = 0;
        for (const Observation& observation : model_.observations)
            if (observation.active)
                if (const auto r = objective.image_residual(state_, observation)) {
                    sum += r->squaredNorm();
                    count += 2;
                }
        return std::sqrt(sum / std::max(1, count));
    }

    void publish() {
        result.rig = rig_.rig();
        result.sigma_px = options_.sigma_px;
        result.rms_px = rms_px();
        result.images = model_.frames();
        result.g_W = state_.gravity;
        for (int i = 0; i < model_.frames(); ++i) {
            const State::Frame& frame = state_.frames[i];
            result.T_W_C.push_back(
                {model_.times[i], Pose{frame.motion.R, frame.motion.p} * model_.T_I_C});
            result.bias.gyro += frame.bias.gyro / model_.frames();
            result.bias.accel += frame.bias.accel / model_.frames();
        }
        const Objective objective(model_, options_, {});
        for (const Observation& observation : model_.observations) {
            ++(observation.active ? result.observations : result.outliers);
            const auto r = objective.image_residual(state_, observation);
            result.residuals.push_back(
                {observation.frame_idx, model_.points[observation.point_idx].id, observation.uv_px,
                 r ? Eigen::Vector2d(-*r)
                   : Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity()),
                 !observation.active});
        }
        result.names = rig_.names();
        result.covariance = covariance();
    }

    RigCalibration result;

 private:
    static constexpr int kFewestImages = 3;  // that a point without survey must be seen in

    Eigen::MatrixXd covariance() {
        Objective objective(model_, options_, stage_);
        objective.linearize(state_, equations_);
        rig_.linearize(objective, state_, equations_);
        const char* const kOpen = "calibration: the measurements do not determine ";
        if (!equations_.factorize())
            throw InputError(std::string(kOpen) + "the motion; check the board's points and ids");
        if (!equations_.rig_solution())
            throw InputError(kOpen + result.names[equations_.weakest_rig_unknown()] +
                             "; move the camera more, about all its axes");
        return equations_.rig_solution()->covariance;
    }

    BatchOptions options_;
    RigUnknowns unknowns_;
    Stage stage_;
    Model model_;
    State state_;
    RigRefinement rig_;
    NormalEquations equations_;
};

}  // namespace

RigCalibration calibrate_rig(const BatchProblem& problem, const BatchOptions& given,
                             const RigQuestion& question, const Estimate& start) {
    constexpr double kFirstSigma_px = 0.5;
    BatchOptions options = given;
    const bool sigma_known = given.sigma_px > 0;
    if (!sigma_known) options.sigma_px = kFirstSigma_px;
    Calibrator calibrator(problem, options, question, start);
    calibrator.minimize("huber");  // far from the solution, where outliers cannot be told
    calibrator.drop_outliers();
    calibrator.minimize(options.loss);
    if (calibrator.drop_outliers()) calibrator.minimize(options.loss);
    if (!sigma_known) {
        calibrator.set_sigma(std::max(1e-4, calibrator.rms_px()));
        calibrator.drop_outliers();
        calibrator.minimize(options.loss);
    }
    calibrator.publish();
    return std::move(calibrator.result);
}

}  // namespace vio
