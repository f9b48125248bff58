#include "libvio/calibration/board_detector.h"

#include <algorithm>
#include <cmath>
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
    Tags(const Tags&) = delete;
    Tags& operator=(const Tags&) = delete;
};

std::vector<FeatureObservation> BoardDetector::detect_tags(const cv::Mat& image) const {
    cv::Mat copy = image.clone();  // AprilTag takes no const pixels
    image_u8_t view{copy.cols, copy.rows, static_cast<int32_t>(copy.step), copy.data};
    zarray_t* found = apriltag_detector_detect(tags_->detector, &view);
    std::vector<FeatureObservation> corners;
    for (int k = 0; k < zarray_size(found); ++k) {
        apriltag_detection_t* tag = nullptr;
        zarray_get(found, k, &tag);
        if (tag->id >= board_.cols * board_.rows || tag->decision_margin < 20) continue;
        std::vector<cv::Point2f> places;
        double edge_px = 1e9;
        for (int c = 0; c < 4; ++c) {
            // AprilTag's (0, 0) is the corner of the first pixel.
            places.emplace_back(tag->p[c][0] - 0.5, tag->p[c][1] - 0.5);
            const double *a = tag->p[c], *b = tag->p[(c + 1) % 4];
            edge_px = std::min(edge_px, std::hypot(a[0] - b[0], a[1] - b[1]));
        }
        const bool inside = std::all_of(places.begin(), places.end(), [&](const cv::Point2f& p) {
            return p.x >= kBorder_px && p.y >= kBorder_px && p.x <= image.cols - 1 - kBorder_px &&
                   p.y <= image.rows - 1 - kBorder_px;
        });
        if (!inside) continue;
        const std::vector<cv::Point2f> first = places;
        refine(image, places, window_for(0.25 * edge_px));  // the gap between tags, or a bit
        // Their order: bottom left, bottom right, top right, top left of the tag.
        const int row = 2 * (static_cast<int>(tag->id) / board_.cols),
                  col = 2 * (static_cast<int>(tag->id) % board_.cols);
        const int rows[] = {row, row, row + 1, row + 1}, cols[] = {col, col + 1, col + 1, col};
        for (int c = 0; c < 4; ++c) {
            constexpr double kLargestMove_px = 2;  // beyond, it has found something else
            if (cv::norm(places[c] - first[c]) > kLargestMove_px) continue;
            corners.push_back({rows[c] * 2 * board_.cols + cols[c], {places[c].x, places[c].y}});
        }
    }
    apriltag_detections_destroy(found);
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
