// Key-frames and the motions between them as a pose graph.
#pragma once

#include <memory>
#include <string>

#include "libvio/base/estimate.h"

namespace vio {

/// Writes the text that mrpt::graphs::CNetworkOfPoses3DInf and the program graph-slam read
/// (share/formats.md) as the estimate comes: a node for each key-frame, and an edge for each motion
/// between two with the inverse of its covariance. A motion whose covariance is not known or has no
/// inverse is left out: the graph then is in pieces, whose nodes all stand in the same frame.
/// Numbers read back to the bit.
class PoseGraphWriter {
 public:
    /// Throws InputError if the file cannot be written, as do the other functions.
    explicit PoseGraphWriter(const std::string& file);
    ~PoseGraphWriter();

    /// Motions, with the states at their ends or after those; in order of time.
    void add(const Estimate& piece);
    /// Completes the file. False, and no file is left, if there was no motion with a covariance.
    bool finish();

    /// The motions that were left out.
    struct LeftOut {
        int count = 0;
        TimeNs from = 0, to = 0;  ///< of the first
    };
    const LeftOut& left_out() const;

 private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// The same at once. Throws InputError where finish() gives false.
void write_pose_graph(const std::string& file, const Estimate& estimate);

}  // namespace vio
