#include "libvio/io/ply.h"

#include <Eigen/Dense>
#include <bit>
#include <concepts>
#include <cstring>
#include <limits>

#include "libvio/io/text.h"

namespace vio {
namespace {

// One row, as text or as bytes.
class Row {
 public:
    explicit Row(bool binary) : binary_(binary) {}
    void add(double value) { binary_ ? bytes(value) : text(format(value)); }
    template <std::integral Integer>
    void add(Integer value) {
        binary_ ? bytes(value) : text(std::to_string(value));
    }
    std::string end() { return binary_ ? row_ : row_ + '\n'; }

 private:
    template <typename Number>
    void bytes(Number value) {
        static_assert(std::endian::native == std::endian::little);
        char raw[sizeof(Number)];
        std::memcpy(raw, &value, sizeof(Number));
        row_.append(raw, sizeof(Number));
    }
    void text(const std::string& number) { row_ += (row_.empty() ? "" : " ") + number; }

    bool binary_;
    std::string row_;
};

}  // namespace

bool wide_ids(FeatureId least, FeatureId greatest) {
    using Narrow = std::numeric_limits<std::int32_t>;
    return least < Narrow::min() || greatest > Narrow::max();
}

std::string ply_header(size_t landmarks, LandmarkColour colour, const PlyRows& rows) {
    std::string text = std::string("ply\nformat ") +
                       (rows.binary ? "binary_little_endian" : "ascii") +
                       " 1.0\ncomment landmarks in W [m]; covariance of the position [m^2]\n"
                       "comment colour " +
                       (colour == LandmarkColour::kImage ? "of the images" : "by uncertainty") +
                       (rows.wide_ids ? "\ncomment whole id = 2^32 id_high + id" : "") +
                       "\nelement vertex " + std::to_string(landmarks) + "\n";
    for (const char* name : {"x", "y", "z"}) text += std::string("property double ") + name + "\n";
    for (const char* name : {"red", "green", "blue"})
        text += std::string("property uchar ") + name + "\n";
    text += std::string("property ") + (rows.wide_ids ? "uint" : "int") +
            " id\nproperty int observations\n";
    for (const char* name : {"xx", "xy", "xz", "yy", "yz", "zz"})
        text += std::string("property double covariance_") + name + "\n";
    if (rows.wide_ids) text += "property int id_high\n";
    return text + "end_header\n";
}

std::string ply_row(const LandmarkEstimate& landmark, const Rgb& rgb, const PlyRows& rows) {
    Row row(rows.binary);
    for (int k = 0; k < 3; ++k) row.add(landmark.p_W(k));
    for (const std::uint8_t channel : rgb) row.add(channel);
    if (rows.wide_ids)
        row.add(static_cast<std::uint32_t>(landmark.id));
    else
        row.add(static_cast<std::int32_t>(landmark.id));
    row.add(static_cast<std::int32_t>(landmark.observations));
    for (int r = 0; r < 3; ++r)
        for (int c = r; c < 3; ++c) row.add(landmark.covariance(r, c));
    if (rows.wide_ids) row.add(static_cast<std::int32_t>(landmark.id >> 32));
    return row.end();
}

void write_ply(const std::string& file, const std::vector<LandmarkEstimate>& landmarks,
               LandmarkColour colour, bool binary) {
    PlyRows rows{binary};
    for (const LandmarkEstimate& landmark : landmarks)
        rows.wide_ids = rows.wide_ids || wide_ids(landmark.id, landmark.id);
    std::string text = ply_header(landmarks.size(), colour, rows);
    const LandmarkColours colours(landmarks, colour);
    for (const LandmarkEstimate& landmark : landmarks)
        text += ply_row(landmark, colours.rgb(landmark), rows);
    write_text(file, text);
}

std::vector<LandmarkEstimate> read_ply(const std::string& file) {
    TextRows rows(file);
    bool image_colours = false, wide = false;
    while (rows.next() && rows.text(0) != "end_header") {
        wide = wide || rows.text(rows.size() - 1) == "id_high";
        image_colours = image_colours ||
                        (rows.size() == 5 && rows.text(1) == "colour" && rows.text(4) == "images");
    }
    std::vector<LandmarkEstimate> landmarks;
    while (rows.next()) {
        rows.require(wide ? 15 : 14);
        LandmarkEstimate landmark;
        for (int k = 0; k < 3; ++k) landmark.p_W(k) = rows.number(static_cast<size_t>(k));
        Rgb rgb;
        for (size_t k = 0; k < 3; ++k) rgb[k] = static_cast<std::uint8_t>(rows.integer(3 + k));
        if (image_colours) landmark.rgb = rgb;
        landmark.id = rows.integer(6);
        landmark.observations = static_cast<int>(rows.integer(7));
        size_t field = 8;
        for (int r = 0; r < 3; ++r)
            for (int c = r; c < 3; ++c)
                landmark.covariance(r, c) = landmark.covariance(c, r) = rows.number(field++);
        if (wide)
            landmark.id =
                static_cast<FeatureId>(static_cast<std::uint64_t>(rows.integer(field)) << 32 |
                                       static_cast<std::uint32_t>(landmark.id));
        landmarks.push_back(landmark);
    }
    return landmarks;
}

}  // namespace vio
