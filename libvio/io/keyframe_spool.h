// Key-frames of a run of any length: on disk until their file is written.
#pragma once

#include <string>

#include "libvio/base/estimate.h"
#include "libvio/camera/rig.h"
#include "libvio/io/gz_stream.h"
#include "libvio/io/landmark_spool.h"

namespace vio {

/// Writes a CSimpleMap: of each key-frame the pose with its covariance and, as observations of
/// classes that every MRPT program knows, the landmarks that it saw: as bearings and ranges with
/// their ids, and as a cloud of points.
class KeyframeSpool {
 public:
    /// Throws InputError if the file cannot be written, as the other functions do.
    KeyframeSpool(const std::string& file, const Rig& rig);

    void add(const FeatureFrame& frame, const StateEstimate& state);

    /// Writes the map, complete or not at all, and removes the spool. landmarks: closed.
    void finish(const std::string& map_file, LandmarkSpool& landmarks);

 private:
    void write_map(const std::string& name, LandmarkSpool& landmarks) const;

    std::string file_;
    Rig rig_;
    GzOutput out_;
    std::uint32_t count_ = 0;
};

}  // namespace vio
