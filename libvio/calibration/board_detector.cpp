#include "libvio/calibration/board_detector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

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

std::vector<FeatureObservation> BoardDetector::detect_tags(const cv::Mat& image) const {
    std::vector<FeatureObservation> corners;
    for (const auto& [id, quad] : tags_->find(image, board_.cols * board_.rows)) {
        std::vector<cv::Point2f> places(quad.begin(), quad.end());
        double edge_px = cv::norm(quad[3] - quad[0]);
        for (int c = 0; c < 3; ++c) edge_px = std::min(edge_px, cv::norm(quad[c] - quad[c + 1]));
        if (!std::all_of(places.begin(), places.end(), [&](const cv::Point2f& p) {
                return p.x >= kBorder_px && p.y >= kBorder_px &&
                       p.x <= image.cols - 1 - kBorder_px && p.y <= image.rows - 1 - kBorder_px;
            }))
            continue;
        refine(image, places, window_for(0.25 * edge_px));  // the gap between tags, or a bit
        // Their order: bottom left, bottom right, top right, top left of the tag.
        const int row = 2 * (id / board_.cols), col = 2 * (id % board_.cols);
        const int rows[] = {row, row, row + 1, row + 1}, cols[] = {col, col + 1, col + 1, col};
        for (int c = 0; c < 4; ++c) {
            constexpr double kLargestMove_px = 2;  // beyond, it has found something else
            if (cv::norm(places[c] - quad[c]) > kLargestMove_px) continue;
            corners.push_back({rows[c] * 2 * board_.cols + cols[c], {places[c].x, places[c].y}});
        }
    }
    return corners;
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

std::vector<FeatureObservation> BoardDetector::detect_tags(const cv::Mat&) const {
    return {};
}

#endif

BoardDetector::BoardDetector(const Board& board) : board_(board) {
    if (board.pattern == Board::Pattern::kNone)
        throw InputError(
            "the board has no pattern to look for in images; describe it by a target.yaml");
    if (board.pattern == Board::Pattern::kAprilGrid) tags_ = std::make_unique<Tags>();
}

BoardDetector::~BoardDetector() = default;

std::vector<FeatureObservation> BoardDetector::detect(const cv::Mat& image) const {
    auto corners = tags_ ? detect_tags(image) : detect_checkerboard(image);
    std::sort(corners.begin(), corners.end(),
              [](const auto& a, const auto& b) { return a.feature_id < b.feature_id; });
    // The same tag twice is none: one of the two is something else.
    std::vector<FeatureObservation> single;
    for (size_t k = 0; k < corners.size(); ++k) {
        const auto same = [&](size_t other) {
            return other < corners.size() && corners[other].feature_id == corners[k].feature_id;
        };
        if (!same(k + 1) && !(k > 0 && same(k - 1))) single.push_back(corners[k]);
    }
    return single;
}

std::vector<FeatureObservation> BoardDetector::detect_checkerboard(const cv::Mat& image) const {
    const int cols = board_.cols, rows = board_.rows;
    std::vector<cv::Point2f> p;
    if (!cv::findChessboardCorners(
            image, {cols, rows}, p,
            cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK))
        return {};
    double square_px = 1e9;
    for (int r = 0; r + 1 < rows; ++r)
        for (int c = 0; c + 1 < cols; ++c)
            square_px = std::min({square_px, cv::norm(p[r * cols + c] - p[r * cols + c + 1]),
                                  cv::norm(p[r * cols + c] - p[(r + 1) * cols + c])});
    refine(image, p, window_for(square_px));
    // Seen from the front, x and y turn the same way in every image.
    const cv::Point2f x = p[cols - 1] - p[0], y = p[(rows - 1) * cols] - p[0];
    if (x.cross(y) < 0)
        for (int r = 0; r < rows; ++r)
            std::reverse(p.begin() + r * cols, p.begin() + (r + 1) * cols);
    // The square at the first corner is dark where the board has a top.
    const auto light = [&](int r, int c) {
        const cv::Point2f centre = (p[r * cols + c] + p[r * cols + c + 1] + p[(r + 1) * cols + c] +
                                    p[(r + 1) * cols + c + 1]) /
                                   4;
        return cv::mean(image(cv::Rect(cvRound(centre.x) - 1, cvRound(centre.y) - 1, 3, 3) &
                              cv::Rect(0, 0, image.cols, image.rows)))[0];
    };
    if (board_.has_top() && light(0, 0) > light(0, 1)) std::reverse(p.begin(), p.end());
    std::vector<FeatureObservation> corners;
    for (size_t k = 0; k < p.size(); ++k)
        corners.push_back({static_cast<FeatureId>(k), {p[k].x, p[k].y}});
    return corners;
}

}  // namespace vio
