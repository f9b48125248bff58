#include "libvio/calibration/board_file.h"

#include "libvio/io/yaml_file.h"

namespace vio {
namespace {

int count(const Yaml& yaml, const std::string& key, int least, int most) {
    const int value = yaml.get<int>(key);
    if (value < least || value > most)
        throw yaml.error(key, "must be " + std::to_string(least) + " to " + std::to_string(most));
    return value;
}

Board from_yaml(const Yaml& yaml) {
    const auto type = yaml.get<std::string>("target_type");
    if (type == "aprilgrid") {
        constexpr int kMost = 24;  // 24 x 24 is about as many as the family has
        const int cols = count(yaml, "tagCols", 1, kMost), rows = count(yaml, "tagRows", 1, kMost);
        return make_april_grid(cols, rows, yaml.positive("tagSize"), yaml.positive("tagSpacing"));
    }
    if (type == "checkerboard") {
        constexpr int kMost = 100;
        const int cols = count(yaml, "targetCols", 3, kMost),
                  rows = count(yaml, "targetRows", 3, kMost);
        return make_checkerboard(cols, rows, yaml.positive("colSpacingMeters"),
                                 yaml.positive("rowSpacingMeters"));
    }
    throw yaml.error("target_type", "is '" + type + "'; aprilgrid or checkerboard is expected");
}

}  // namespace

std::map<FeatureId, Fiducial> read_fiducials(const std::string& file) {
    std::map<FeatureId, Fiducial> fiducials;
    TextRows rows(file);
    while (rows.next()) {
        rows.require(4);
        Fiducial& fiducial = fiducials[rows.integer(0)];
        fiducial.p_W = {rows.number(1), rows.number(2), rows.number(3)};
        if (rows.size() < 5) continue;
        const double sigma = rows.number(4);
        if (sigma < 0) throw rows.error("sigma is negative; expected feature_id,x,y,z[,sigma] [m]");
        fiducial.covariance = Eigen::Matrix3d::Identity() * sigma * sigma;
    }
    if (fiducials.empty())
        throw InputError(file + ": no rows; expected feature_id,x,y,z[,sigma] [m]");
    return fiducials;
}

Board read_board(const std::string& file) {
    const std::string extension = std::filesystem::path(file).extension();
    if (extension == ".yaml" || extension == ".yml") return from_yaml(Yaml(file));
    Board board;
    board.points = read_fiducials(file);
    return board;
}

}  // namespace vio
