// Either estimator behind one face, so that the pipeline reads the same for both.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "app/pipeline.h"
#include "libvio/base/estimate.h"

namespace vio::app {

/// Takes measurements, gives the estimate; made by make_estimator().
class Estimator {
 public:
    virtual ~Estimator() = default;

    /// Measurements in order of arrival.
    virtual void add(const ImuReading& reading) = 0;
    virtual void add(const FeatureFrame& frame) = 0;
    /// Call once after the last measurement; throws InputError where nothing can be estimated.
    virtual void finish() = 0;

    /// What has become final since the last call (Iekf::take); all of it after finish(), for the
    /// batch estimator only then.
    virtual Estimate take() = 0;
    /// Landmarks in the state, which are not final yet; none of the batch.
    virtual std::vector<LandmarkEstimate> landmarks() const = 0;
    /// How the minimisation went, in words; empty for the filter, whose events tell.
    virtual std::string report() const = 0;
    /// What happened on the way: starts, losses of track.
    virtual std::vector<StatusEntry> events() const = 0;
    /// Whether the estimate is what the method aims at; otherwise report() says why not.
    virtual bool converged() const = 0;
    /// Steps of the minimisation; 0 for the filter.
    virtual int iterations() const = 0;
    /// The rig as estimated, after finish(); nothing where it was taken as stated.
    virtual const RefinedRig* refined_rig() const = 0;
    /// Features found to be tracked wrongly since the last call.
    virtual std::vector<FeatureId> take_rejected() = 0;
    /// Where features will be in an image at time t; nothing of the batch estimator.
    virtual std::vector<PredictedFeature> predict(TimeNs t) const = 0;
};

/// The estimator that the request names.
std::unique_ptr<Estimator> make_estimator(const RunRequest& request, const Rig& rig);

}  // namespace vio::app
