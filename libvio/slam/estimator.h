// Either estimator behind one face, so that what feeds them reads the same for both.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/batch/batch.h"
#include "libvio/recursive/iekf.h"
#include "libvio/tracking/tracker.h"

namespace vio {

/// Options of every stage from measurements to the estimate.
struct EstimationOptions {
    TrackerOptions tracker;
    BatchOptions batch;
    IekfOptions iekf;

    void describe(OptionSet& options);
};

/// What is to be estimated, and from what.
struct EstimationRequest {
    std::string estimator = "iekf";  ///< batch | iekf
    bool use_imu = true;             ///< false: from images alone
    EstimationOptions options;
    std::map<FeatureId, Fiducial> fiducials;  ///< known points for the batch estimator
    /// What the batch estimate starts from; nothing: as BatchOptions::start says, where auto is the
    /// recursive estimate and, if there is none or it does not lead to a minimum, staged.
    std::optional<Estimate> start;
};

/// Takes measurements, gives the estimate; made by make_estimator().
class Estimator {
 public:
    virtual ~Estimator() = default;

    /// Measurements in order of arrival.
    virtual void add(const ImuReading& reading) = 0;
    virtual void add(const FeatureFrame& frame) = 0;
    /// Call once after the last measurement. Throws InputError for measurements that cannot be
    /// estimated from (estimate_batch); where the estimator found no pose, newest() is null.
    virtual void finish() = 0;

    /// What has become final since the last call (Iekf::take); all of it after finish(), for the
    /// batch estimator only then.
    virtual Estimate take() = 0;
    /// What has not been taken, with landmarks that are not final yet (Iekf::estimate).
    virtual const Estimate& estimate() const = 0;
    /// The last state, taken or not; null before the start (of the batch: before finish()).
    virtual const StateEstimate* newest() const = 0;
    /// How the minimisation went, in words; empty for the filter, whose status tells.
    virtual std::string report() const = 0;
    /// What happened on the way: starts, losses of track.
    virtual const std::vector<StatusEntry>& status() const = 0;
    /// Whether the estimate is what the method aims at; otherwise report() says why not.
    virtual bool converged() const = 0;
    /// Steps of the minimisation; 0 for the filter.
    virtual int iterations() const = 0;
    /// The rig as estimated, after finish(); nothing where it was taken as stated. (The filter's
    /// mount takes up what else its model leaves out: it is no calibration.)
    virtual const RefinedRig* refined_rig() const = 0;
    /// Features found to be tracked wrongly since the last call.
    virtual std::vector<FeatureId> take_rejected() = 0;
    /// Where features will be in an image at time t; nothing of the batch estimator.
    virtual std::vector<PredictedFeature> predict(TimeNs t) const = 0;
};

/// The estimator that the request names. Throws InputError if the rig has no camera, and for
/// options that the estimator has not.
std::unique_ptr<Estimator> make_estimator(const EstimationRequest& request, const Rig& rig);

}  // namespace vio
