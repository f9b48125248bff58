#include "libvio/calibration/board.h"

namespace vio {

bool Board::has_top() const {
    return pattern != Pattern::kCheckerboard || (cols + rows) % 2 != 0;
}

Board make_checkerboard(int cols, int rows, double col_spacing, double row_spacing) {
    Board board{Board::Pattern::kCheckerboard, cols, rows, {}};
    for (int r = 0; r < rows; ++r)
        for (int c = 0; c < cols; ++c)
            board.points[r * cols + c].p_W = {c * col_spacing, r * row_spacing, 0};
    return board;
}

Board make_april_grid(int cols, int rows, double tag_size, double spacing) {
    Board board{Board::Pattern::kAprilGrid, cols, rows, {}};
    const auto place = [&](int corner) {
        const int tag = corner / 2;
        return tag_size * (tag * (1 + spacing) + corner % 2);
    };
    for (int r = 0; r < 2 * rows; ++r)
        for (int c = 0; c < 2 * cols; ++c)
            board.points[r * 2 * cols + c].p_W = {place(c), place(r), 0};
    return board;
}

std::vector<LandmarkEstimate> landmarks_of(const std::map<FeatureId, Fiducial>& points) {
    std::vector<LandmarkEstimate> landmarks;
    for (const auto& [id, point] : points) {
        LandmarkEstimate landmark;
        landmark.id = id;
        landmark.p_W = point.p_W;
        landmarks.push_back(landmark);
    }
    return landmarks;
}

}  // namespace vio
