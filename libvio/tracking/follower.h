// Finds the features of earlier images in a new one.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "libvio/camera/camera.h"
#include "libvio/tracking/image_pyramid.h"
#include "libvio/tracking/track.h"
#include "libvio/tracking/tracker.h"

namespace vio {

/// The steps of following, in this order, once each track knows where it is expected. Each sets
/// uv, f, A and seen of the tracks that it finds, and counts in the report.
class Follower {
 public:
    Follower(const TrackerOptions& options, CameraPtr camera, const ImagePyramid& images)
        : options_(options), camera_(std::move(camera)), images_(images) {}

    /// Zero where features are not wanted; empty: nowhere.
    void set_mask(cv::Mat mask) { mask_ = std::move(mask); }
    const cv::Mat& mask() const { return mask_; }

    /// Frame to frame, the tracks that the previous image showed.
    void flow(std::vector<Track>& tracks, TrackerReport& report) const;
    /// Those found with their looks: frame-to-frame tracking drifts, the look does not.
    void align(std::vector<Track>& tracks, TrackerReport& report) const;
    /// Those outside their ellipses are taken as not found, unless most are: then it is the
    /// estimator that errs, and its ellipses are forgotten.
    void hold_to_regions(std::vector<Track>& tracks) const;
    /// The others, within their ellipses or around where their neighbours let expect them.
    void search(std::vector<Track>& tracks, TrackerReport& report) const;

 private:
    bool align(Track& track, const Eigen::Vector2d& uv) const;
    bool admissible(Track& track) const;
    void renew_look(Track& track) const;

    const TrackerOptions& options_;
    CameraPtr camera_;
    const ImagePyramid& images_;
    cv::Mat mask_;
};

}  // namespace vio
