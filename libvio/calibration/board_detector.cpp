#include "libvio/calibration/board_detector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "libvio/base/errors.h"

#ifdef VIO_HAVE_APRILTAG
extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
}
#endif

namespace vio {
namespace {

constexpr int kBorder_px = 4;  // corners nearer to the image's border are not refined: left out

void refine(const cv::Mat& image, std::vector<cv::Point2f>& corners, int half_window) {
    cv::cornerSubPix(image, corners, {half_window, half_window}, {-1, -1},
                     {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 40, 1e-3});
}

// Window for refinement: as large as the pattern's squares in the image let it be.
int window_for(double square_px) {
    return std::clamp(static_cast<int>(0.4 * square_px), 2, 7);
}

}  // namespace

// An image, and where its board is looked for: in itself or in a view of it.
struct BoardDetector::Look {
    const cv::Mat& image;
    cv::Mat view;
    const PerspectiveViews* views = nullptr;
    int view_idx = 0;

    // Places in the image of places in the view; empty unless all are inside, with such a border.
    std::vector<cv::Point2f> in_image(const std::vector<cv::Point2f>& in_view,
                                      float border_px = 0) const {
        std::vector<cv::Point2f> places;
        for (const cv::Point2f& p : in_view) {
            const auto place = views ? views->in_image(view_idx, p) : p;
            if (!place || !(place->x >= border_px && place->y >= border_px &&
                            place->x <= static_cast<float>(image.cols - 1) - border_px &&
                            place->y <= static_cast<float>(image.rows - 1) - border_px))
                return {};
            places.push_back(*place);
        }
        return places;
    }
};

#ifdef VIO_HAVE_APRILTAG

bool BoardDetector::knows_april_grids() {
    return true;
}

// The detector with the family at both widths of its border. AprilTag's codes are for a border of
// one bit; one of two moves each bit by one.
struct BoardDetector::Tags {
    apriltag_detector_t* detector = apriltag_detector_create();
    apriltag_family_t *thin = tag36h11_create(), *wide = tag36h11_create();

    Tags() {
        wide->width_at_border += 2;
        wide->total_width += 2;
        for (uint32_t k = 0; k < wide->nbits; ++k) {
            ++wide->bit_x[k];
            ++wide->bit_y[k];
        }
        apriltag_detector_add_family_bits(detector, thin, 1);
        apriltag_detector_add_family_bits(detector, wide, 1);
        detector->quad_decimate = 1;
        detector->nthreads = 1;
    }
    ~Tags() {
        apriltag_detector_destroy(detector);
        tag36h11_destroy(thin);
        tag36h11_destroy(wide);
    }
    // Corners of each tag with an id below `ids`, as AprilTag orders them.
    std::map<int, std::array<cv::Point2f, 4>> find(const cv::Mat& image, int ids) const;

    Tags(const Tags&) = delete;
    Tags& operator=(const Tags&) = delete;
};

namespace {

using Quad = std::array<cv::Point2f, 4>;

// The quadrilateral with each edge moved outwards by some pixels.
Quad grown(const Quad& quad, float by) {
    const auto centre = (quad[0] + quad[1] + quad[2] + quad[3]) / 4;
    std::array<cv::Point2f, 4> normal;
    std::array<float, 4> offset;
    for (int k = 0; k < 4; ++k) {  // edge from corner k to the next: normal . x = offset
        const cv::Point2f along = quad[(k + 1) % 4] - quad[k];
        cv::Point2f n(along.y, -along.x);
        n /= static_cast<float>(cv::norm(n));
        if (n.dot(quad[k] - centre) < 0) n = -n;
        normal[k] = n;
        offset[k] = n.dot(quad[k]) + by;
    }
    Quad result;
    for (int k = 0; k < 4; ++k) {
        const int before = (k + 3) % 4;
        const float det = normal[before].cross(normal[k]);
        result[k] = {(offset[before] * normal[k].y - offset[k] * normal[before].y) / det,
                     (offset[k] * normal[before].x - offset[before] * normal[k].x) / det};
    }
    return result;
}

}  // namespace

// Kalibr's boards have black squares where gaps cross, which touch the tags' corners and merge with
// them in the image. Where black is eroded by a pixel or two, they come apart.
std::map<int, Quad> BoardDetector::Tags::find(const cv::Mat& image, int ids) const {
    std::map<int, Quad> quads;
    // Enlarged, a smaller part of a pixel does; the others are for blurred images.
    struct Pass {
        int scale, erosion;
    };
    for (const Pass pass : {Pass{2, 1}, Pass{1, 1}, Pass{1, 2}}) {
        cv::Mat larger = image, eroded;  // a copy, since AprilTag takes no const pixels
        if (pass.scale > 1) cv::resize(image, larger, {}, pass.scale, pass.scale, cv::INTER_CUBIC);
        const int size = 2 * pass.erosion + 1;
        cv::dilate(larger, eroded, cv::getStructuringElement(cv::MORPH_RECT, {size, size}));
        image_u8_t view{eroded.cols, eroded.rows, static_cast<int32_t>(eroded.step), eroded.data};
        const size_t before = quads.size();
        zarray_t* found = apriltag_detector_detect(detector, &view);
        for (int k = 0; k < zarray_size(found); ++k) {
            apriltag_detection_t* tag = nullptr;
            zarray_get(found, k, &tag);
            constexpr float kLeastMargin = 20;
            if (tag->id >= ids || tag->decision_margin < kLeastMargin) continue;
            Quad quad;  // AprilTag's (0, 0) is the corner of the first pixel
            for (int c = 0; c < 4; ++c)
                quad[c] = {static_cast<float>(tag->p[c][0] / pass.scale) - 0.5F,
                           static_cast<float>(tag->p[c][1] / pass.scale) - 0.5F};
            quads.emplace(tag->id, grown(quad, static_cast<float>(pass.erosion) / pass.scale));
        }
        apriltag_detections_destroy(found);
        if (!quads.empty() && quads.size() == before) break;
    }
    return quads;
}

void BoardDetector::find_tags(const Look& look, std::vector<FeatureObservation>& corners) const {
    for (const auto& [id, quad] : tags_->find(look.view, board_.cols * board_.rows)) {
        std::vector<cv::Point2f> places = look.in_image({quad.begin(), quad.end()}, kBorder_px);
        if (places.empty()) continue;
        const std::vector<cv::Point2f> before = places;
        double edge_px = cv::norm(places[3] - places[0]);
        for (int c = 0; c < 3; ++c)
            edge_px = std::min(edge_px, cv::norm(places[c] - places[c + 1]));
        refine(look.image, places, window_for(0.25 * edge_px));  // the gap between tags, or a bit
        // Their order: bottom left, bottom right, top right, top left of the tag.
        const int row = 2 * (id / board_.cols), col = 2 * (id % board_.cols);
        const int rows[] = {row, row, row + 1, row + 1}, cols[] = {col, col + 1, col + 1, col};
        for (int c = 0; c < 4; ++c) {
            constexpr double kLargestMove_px = 2;  // beyond, it has found something else
            if (cv::norm(places[c] - before[c]) > kLargestMove_px) continue;
            corners.push_back({rows[c] * 2 * board_.cols + cols[c], {places[c].x, places[c].y}});
        }
    }
}

#else

bool BoardDetector::knows_april_grids() {
    return false;
}

struct BoardDetector::Tags {
    Tags() {
        throw InputError(
            "AprilGrid: this program was built without AprilTag; install libapriltag-dev and build "
            "again, or use a checkerboard");
    }
};

void BoardDetector::find_tags(const Look&, std::vector<FeatureObservation>&) const {}

#endif

BoardDetector::BoardDetector(const Board& board, CameraPtr camera) : board_(board) {
    if (board.pattern == Board::Pattern::kNone)
        throw InputError(
            "the board has no pattern to look for in images; describe it by a target.yaml");
    if (board.pattern == Board::Pattern::kAprilGrid) tags_ = std::make_unique<Tags>();
    if (camera) views_ = std::make_unique<PerspectiveViews>(std::move(camera));
}

BoardDetector::~BoardDetector() = default;

std::vector<FeatureObservation> BoardDetector::detect(const cv::Mat& image) const {
    std::vector<FeatureObservation> corners;
    if (!views_) find({image, image}, corners);
    for (int k = 0; views_ && k < views_->count(); ++k)
        find({image, views_->draw(k, image), views_.get(), k}, corners);
    std::stable_sort(corners.begin(), corners.end(),
                     [](const auto& a, const auto& b) { return a.feature_id < b.feature_id; });
    // Views share much. But the same corner in two places is none: one of the two is something
    // else.
    constexpr double kSame_px = 0.5;
    std::vector<FeatureObservation> single;
    for (size_t k = 0, next = 0; k < corners.size(); k = next) {
        bool same = true;
        for (next = k + 1;
             next < corners.size() && corners[next].feature_id == corners[k].feature_id; ++next)
            same = same && (corners[next].uv_px - corners[k].uv_px).norm() <= kSame_px;
        if (same) single.push_back(corners[k]);
    }
    return single;
}

void BoardDetector::find(const Look& look, std::vector<FeatureObservation>& corners) const {
    if (tags_)
        find_tags(look, corners);
    else if (corners.empty())
        find_checkerboard(look, corners);
}

void BoardDetector::find_checkerboard(const Look& look,
                                      std::vector<FeatureObservation>& corners) const {
    const int cols = board_.cols, rows = board_.rows;
    std::vector<cv::Point2f> p;
    // By squares in one black and white image, which is quick and holds in bent images; else by
    // sectors, which hold in uneven light and blur. (By squares at many thresholds takes a second
    // where a board is seen in part, and finds fewer.)
    if (!cv::findChessboardCorners(look.view, {cols, rows}, p, cv::CALIB_CB_FAST_CHECK) &&
        !cv::findChessboardCornersSB(look.view, cv::Size(cols, rows), p,
                                     cv::CALIB_CB_NORMALIZE_IMAGE))
        return;
    // Seen from the front, x and y turn the same way in every view.
    const cv::Point2f x = p[cols - 1] - p[0], y = p[(rows - 1) * cols] - p[0];
    if (x.cross(y) < 0)
        for (int r = 0; r < rows; ++r)
            std::reverse(p.begin() + r * cols, p.begin() + (r + 1) * cols);
    // The square at the first corner is dark where the board has a top.
    const auto light = [&](int r, int c) {
        const cv::Point2f centre = (p[r * cols + c] + p[r * cols + c + 1] + p[(r + 1) * cols + c] +
                                    p[(r + 1) * cols + c + 1]) /
                                   4;
        return cv::mean(look.view(cv::Rect(cvRound(centre.x) - 1, cvRound(centre.y) - 1, 3, 3) &
                                  cv::Rect(0, 0, look.view.cols, look.view.rows)))[0];
    };
    if (board_.has_top() && light(0, 0) > light(0, 1)) std::reverse(p.begin(), p.end());
    std::vector<cv::Point2f> places = look.in_image(p);
    if (places.empty()) return;
    double square_px = 1e9;
    for (int r = 0; r + 1 < rows; ++r)
        for (int c = 0; c + 1 < cols; ++c)
            square_px =
                std::min({square_px, cv::norm(places[r * cols + c] - places[r * cols + c + 1]),
                          cv::norm(places[r * cols + c] - places[(r + 1) * cols + c])});
    refine(look.image, places, window_for(square_px));
    for (size_t k = 0; k < places.size(); ++k)
        corners.push_back({static_cast<FeatureId>(k), {places[k].x, places[k].y}});
}

}  // namespace vio
