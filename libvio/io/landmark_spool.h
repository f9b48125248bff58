// Landmarks of a run of any length: on disk until their files are written.
#pragma once

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/io/landmark_colour.h"

namespace vio {

/// Landmarks in order of arrival; in memory only their ids, while they are put in order.
class LandmarkSpool {
 public:
    explicit LandmarkSpool(const std::string& file);

    /// Of several with one id the last counts. Throws InputError if the disk is full.
    void add(const LandmarkEstimate& landmark);

    /// Ends the adding.
    void close();
    int count() const { return static_cast<int>(order_.size()); }
    /// After close().
    std::optional<LandmarkEstimate> find(FeatureId id);
    /// The id, or where one of all ids does not fit 32 bits the landmark's row in landmarks.ply,
    /// from 0, for formats that have no more. Of one that find() finds.
    std::int32_t narrow_id(FeatureId id) const;
    /// Writes landmarks.ply and landmarks.txt, in order of id. After close(). Throws InputError.
    void write(const std::filesystem::path& folder);
    /// Forgets all, and removes the file.
    void remove();

 private:
    // A landmark in the file: position in W [m], upper triangle of its covariance [m^2].
    struct Record {
        std::int64_t id, observations;
        double p_W[3], covariance[6];
        std::uint8_t rgb[3], has_rgb;
    };
    // Where the newest record of a landmark is, counted in records.
    struct Place {
        FeatureId id;
        std::int64_t record;
    };

    using Places = std::vector<Place>;
    Places::const_iterator place_of(FeatureId id) const;  // end: none
    bool has_wide_ids() const;
    LandmarkEstimate read(std::int64_t record);
    void write_ply(const std::string& name);
    void write_text(const std::string& name);

    std::string file_;
    std::ofstream out_;
    std::ifstream in_;
    Places order_;  // by id
    LandmarkColour colour_ = LandmarkColour::kUncertainty;
};

}  // namespace vio
