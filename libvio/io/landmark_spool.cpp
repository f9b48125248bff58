#include "libvio/io/landmark_spool.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cstdio>

#include "libvio/io/ply.h"
#include "libvio/io/text.h"

namespace vio {
LandmarkSpool::LandmarkSpool(const std::string& file)
    : file_(file), out_(file, std::ios::binary | std::ios::trunc) {}

void LandmarkSpool::add(const LandmarkEstimate& landmark) {
    Record r{};
    r.id = landmark.id;
    r.observations = landmark.observations;
    std::copy_n(landmark.p_W.data(), 3, r.p_W);
    int at = 0;
    for (int row = 0; row < 3; ++row)
        for (int col = row; col < 3; ++col) r.covariance[at++] = landmark.covariance(row, col);
    if (landmark.rgb) {
        r.has_rgb = 1;
        std::copy_n(landmark.rgb->data(), 3, r.rgb);
        colour_ = LandmarkColour::kImage;
    }
    out_.write(reinterpret_cast<const char*>(&r), sizeof r);
    if (!out_) throw cannot_write(file_);
}

LandmarkEstimate LandmarkSpool::read(std::int64_t record) {
    in_.seekg(record * static_cast<std::int64_t>(sizeof(Record)));
    Record r{};
    if (!in_.read(reinterpret_cast<char*>(&r), sizeof r))
        throw InputError(file_ + ": cannot be read back");
    LandmarkEstimate landmark;
    landmark.id = r.id;
    landmark.observations = static_cast<int>(r.observations);
    landmark.p_W = Eigen::Vector3d(r.p_W);
    int at = 0;
    for (int row = 0; row < 3; ++row)
        for (int col = row; col < 3; ++col)
            landmark.covariance(row, col) = landmark.covariance(col, row) = r.covariance[at++];
    if (r.has_rgb) landmark.rgb = {r.rgb[0], r.rgb[1], r.rgb[2]};
    return landmark;
}

void LandmarkSpool::close() {
    if (!out_.flush()) throw cannot_write(file_);
    in_.open(file_, std::ios::binary);
    const auto count =
        static_cast<std::int64_t>(std::filesystem::file_size(file_) / sizeof(Record));
    for (std::int64_t i = 0; i < count; ++i) order_.push_back({read(i).id, i});
    // The last record of each id.
    std::sort(order_.begin(), order_.end(), [](const Place& a, const Place& b) {
        return std::pair(a.id, -a.record) < std::pair(b.id, -b.record);
    });
    const auto same = [](const Place& a, const Place& b) { return a.id == b.id; };
    order_.erase(std::unique(order_.begin(), order_.end(), same), order_.end());
}

LandmarkSpool::Places::const_iterator LandmarkSpool::place_of(FeatureId id) const {
    const auto place =
        std::lower_bound(order_.begin(), order_.end(), id,
                         [](const Place& p, FeatureId other) { return p.id < other; });
    return place == order_.end() || place->id != id ? order_.end() : place;
}

std::optional<LandmarkEstimate> LandmarkSpool::find(FeatureId id) {
    const auto place = place_of(id);
    if (place == order_.end()) return std::nullopt;
    return read(place->record);
}

bool LandmarkSpool::has_wide_ids() const {
    return !order_.empty() && wide_ids(order_.front().id, order_.back().id);
}

std::int32_t LandmarkSpool::narrow_id(FeatureId id) const {
    return static_cast<std::int32_t>(has_wide_ids() ? place_of(id) - order_.begin() : id);
}

void LandmarkSpool::write(const std::filesystem::path& folder) {
    write_complete(folder / "landmarks.ply", [&](const std::string& name) { write_ply(name); });
    write_complete(folder / "landmarks.txt", [&](const std::string& name) { write_text(name); });
}

void LandmarkSpool::write_ply(const std::string& name) {
    std::vector<double> sigmas;
    for (const Place& place : order_) sigmas.push_back(position_sigma(read(place.record)));
    const LandmarkColours colours(std::move(sigmas), colour_);
    std::ofstream out(name, std::ios::binary);
    const PlyRows rows{false, has_wide_ids()};
    out << ply_header(order_.size(), colour_, rows);
    for (const Place& place : order_) {
        const LandmarkEstimate landmark = read(place.record);
        out << ply_row(landmark, colours.rgb(landmark), rows);
    }
    if (!out.flush()) throw cannot_write(name);
}

// As mrpt::maps::CSimplePointsMap writes and reads it.
void LandmarkSpool::write_text(const std::string& name) {
    std::ofstream out(name, std::ios::binary);
    char row[128];
    for (const Place& place : order_) {
        const Eigen::Vector3f p = read(place.record).p_W.cast<float>();
        std::snprintf(row, sizeof row, "%f %f %f\n", double(p.x()), double(p.y()), double(p.z()));
        out << row;
    }
    if (!out.flush()) throw cannot_write(name);
}

void LandmarkSpool::remove() {
    in_.close();
    order_.clear();
    std::filesystem::remove(file_);
}

}  // namespace vio
