#include "libvio/slam/estimator.h"

#include <algorithm>
#include <sstream>
#include <utility>

#include "libvio/base/errors.h"
#include "libvio/batch/rig_refinement.h"

namespace vio {
namespace {

// Collects everything; the estimate is made in finish().
class Batch final : public Estimator {
 public:
    Batch(const EstimationRequest& request, const Rig& rig)
        : options_(request.options.batch), start_(request.start) {
        problem_.rig = rig;
        problem_.fiducials = request.fiducials;
        if ((options_.start != "auto" && options_.start != "iekf") || start_) return;
        starter_.emplace(rig, request.options.iekf, options_, request.use_imu);
    }

    void add(const ImuReading& reading) override {
        problem_.imu.push_back(reading);
        if (starter_) starter_->add(reading);
    }
    void add(const FeatureFrame& frame) override {
        problem_.frames.push_back(frame);
        if (starter_) starter_->add(frame);
    }
    void finish() override {
        if (starter_)
            finish_from_filter();
        else
            result_ = estimate_batch(problem_, options_, start_);
        if (!result_.estimate.states.empty()) newest_ = result_.estimate.states.back();
    }

    Estimate take() override { return std::exchange(result_.estimate, {}); }
    const Estimate& estimate() const override { return result_.estimate; }
    const StateEstimate* newest() const override { return newest_ ? &*newest_ : nullptr; }
    std::string report() const override {
        const BatchReport& r = result_.report;
        if (!newest_) return r.reason;
        std::ostringstream text;
        text << r.reason << ", " << r.iterations << " iterations, cost " << r.final_cost
             << " (image " << r.image_cost << ", inertial " << r.inertial_cost << ", prior "
             << r.prior_cost << "), " << r.outliers << " of " << r.observations + r.outliers
             << " observations dropped";
        if (r.scale_sigma > 0) text << ", scale known to " << 100 * r.scale_sigma << " %";
        return text.str();
    }
    const std::vector<StatusEntry>& status() const override {
        return starter_ ? starter_->status() : no_status_;
    }
    bool converged() const override { return result_.report.converged; }
    int iterations() const override { return result_.report.iterations; }
    const RefinedRig* refined_rig() const override { return result_.rig ? &*result_.rig : nullptr; }
    std::vector<FeatureId> take_rejected() override { return {}; }
    std::vector<PredictedFeature> predict(TimeNs) const override { return {}; }

 private:
    // The recursive estimate is the start. With `auto`, where that does not lead to a minimum, the
    // estimate is grown from a prefix instead; what there is is kept if that is no better.
    void finish_from_filter() {
        starter_->finish();
        const Estimate start = starter_->take();
        if (start.states.empty())
            result_.report.reason = "the recursive estimator gave no start: " + why_no_start();
        else
            result_ = estimate_batch(problem_, options_, start);
        if (options_.start != "auto" || result_.report.converged) return;
        BatchResult grown = estimate_batch(problem_, options_);
        if (!grown.report.converged && !result_.estimate.states.empty()) return;
        const std::string led_to = start.states.empty() ? "" : "from the recursive estimate: ";
        grown.report.reason += " (from a staged start; " + led_to + result_.report.reason + ")";
        result_ = std::move(grown);
    }

    std::string why_no_start() const {
        return starter_->status().empty() ? "too few images" : starter_->status().back().text;
    }

    BatchProblem problem_;
    BatchOptions options_;
    std::optional<Iekf> starter_;    // if the start is to come from it
    std::optional<Estimate> start_;  // that was given
    BatchResult result_;
    std::optional<StateEstimate> newest_;
    std::vector<StatusEntry> no_status_;
};

class Recursive final : public Estimator {
 public:
    Recursive(const Rig& rig, const IekfOptions& options, const BatchOptions& prefix, bool use_imu)
        : filter_(rig, options, prefix, use_imu) {}

    void add(const ImuReading& reading) override { filter_.add(reading); }
    void add(const FeatureFrame& frame) override { filter_.add(frame); }
    void finish() override {
        filter_.finish();
        rig_ = filter_.refined_rig();
    }

    Estimate take() override {
        tracked_ = converged();
        return filter_.take();
    }
    const Estimate& estimate() const override { return filter_.estimate(); }
    const StateEstimate* newest() const override { return filter_.newest(); }
    std::string report() const override {
        return newest() && !converged()
                   ? "track was lost all the time: its poses are those of a motion not known"
                   : "";
    }
    const std::vector<StatusEntry>& status() const override { return filter_.status(); }
    bool converged() const override {
        const std::vector<StateEstimate>& states = estimate().states;
        return tracked_ || std::any_of(states.begin(), states.end(),
                                       [](const StateEstimate& s) { return !s.lost; });
    }
    int iterations() const override { return 0; }
    const RefinedRig* refined_rig() const override { return rig_ ? &*rig_ : nullptr; }
    std::vector<FeatureId> take_rejected() override { return filter_.take_rejected(); }
    std::vector<PredictedFeature> predict(TimeNs t) const override { return filter_.predict(t); }

 private:
    Iekf filter_;
    std::optional<RefinedRig> rig_;
    bool tracked_ = false;  // at any time of what has been taken
};

}  // namespace

void EstimationOptions::describe(OptionSet& options) {
    tracker.describe(options);
    batch.describe(options);
    iekf.describe(options);
}

std::unique_ptr<Estimator> make_estimator(const EstimationRequest& request, const Rig& rig) {
    const EstimationOptions& options = request.options;
    if (request.estimator == "batch") return std::make_unique<Batch>(request, rig);
    if (batch::rig_unknowns(rig, options.batch).count() > 0)
        throw InputError(
            "options: batch.intrinsics_sigma, extrinsics_*_sigma and time_offset_sigma act with "
            "the batch estimator (--estimator batch); the recursive estimator has "
            "iekf.camera_rotation_sigma, camera_position_sigma and time_offset_sigma");
    return std::make_unique<Recursive>(rig, options.iekf, options.batch, request.use_imu);
}

}  // namespace vio
