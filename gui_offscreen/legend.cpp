#include "gui_offscreen/legend.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "gui_offscreen/palette.h"

namespace vio {
namespace {

using mrpt::img::TColor;

constexpr int kFont = cv::FONT_HERSHEY_DUPLEX;

cv::Scalar bgr(const TColor& c) {
    return {double(c.B), double(c.G), double(c.R)};
}

struct Row {
    enum Mark { kLine, kGradient, kDots, kDisc, kArrow, kGrid, kFrustum } mark;
    std::string label;
    TColor color;
};

bool is_dark(const mrpt::opengl::COpenGLScene& scene) {
    const auto c = scene.getViewport()->getCustomBackgroundColor();
    return 0.3f * c.R + 0.6f * c.G + 0.1f * c.B < 0.5f;
}

std::vector<Row> rows_of(const mrpt::opengl::COpenGLScene& scene) {
    std::vector<Row> paths, rest;
    for (const auto& object : *scene.getViewport()) {
        const std::string name = object->getName();
        const TColor color = object->getColor_u8();
        if (name.starts_with("path "))
            paths.push_back({Row::kLine, name.substr(5), color});
        else if (name.starts_with("landmarks"))
            rest.push_back({name.find("sigma") == std::string::npos ? Row::kDots : Row::kGradient,
                            name, color});
        else if (name.starts_with("position, "))
            rest.push_back({Row::kDisc, name, color});
        else if (name == "cameras")
            rest.push_back({Row::kFrustum, name, color});
        else if (name == "gravity")
            rest.push_back({Row::kArrow, name, color});
        else if (name.starts_with("grid "))
            rest.push_back({Row::kGrid, name, color});
    }
    // The estimate is drawn after the others but named first, its lost stretches last.
    std::vector<Row> rows(paths.rbegin(), paths.rend());
    std::stable_partition(rows.begin(), rows.end(),
                          [](const Row& row) { return row.label != "lost"; });
    rows.insert(rows.end(), rest.begin(), rest.end());
    return rows;
}

void draw_mark(cv::Mat& picture, const Row& row, const cv::Rect& place, double size, bool dark) {
    const int thickness = std::max(1, cvRound(3 * size));
    const cv::Point left(place.x, place.y + place.height / 2), right(place.x + place.width, left.y),
        centre((left + right) / 2);
    switch (row.mark) {
        case Row::kLine:
            cv::line(picture, left, right, bgr(row.color), thickness, cv::LINE_AA);
            break;
        case Row::kGradient:
            for (int x = 0; x < place.width; ++x)
                cv::line(picture, {left.x + x, left.y - thickness},
                         {left.x + x, left.y + thickness},
                         bgr(to_color(uncertainty_colour(double(x) / place.width, dark))));
            break;
        case Row::kDots:
            for (const auto& [share, dot] : {std::pair{0.2, cv::Scalar(150, 150, 150)},
                                             {0.5, cv::Scalar(80, 120, 190)},
                                             {0.8, cv::Scalar(110, 140, 70)}})
                cv::circle(picture, {left.x + cvRound(share * place.width), left.y},
                           std::max(1, cvRound(2.5 * size)), dot, cv::FILLED, cv::LINE_AA);
            break;
        case Row::kDisc: {
            cv::Mat under = picture(place);
            cv::Mat over = under.clone();
            cv::ellipse(over, {place.width / 2, place.height / 2},
                        {place.width * 2 / 5, place.height * 2 / 5}, 0, 0, 360, bgr(row.color),
                        cv::FILLED, cv::LINE_AA);
            cv::addWeighted(over, 0.6, under, 0.4, 0, under);
            break;
        }
        case Row::kArrow:
            cv::arrowedLine(picture, left, right, bgr(row.color), std::max(1, cvRound(2 * size)),
                            cv::LINE_AA, 0, 0.35);
            break;
        case Row::kFrustum: {
            const int half = place.height * 2 / 5, thin = std::max(1, cvRound(1.2 * size));
            const cv::Point apex(centre.x - half, centre.y),
                above(centre.x + half, centre.y - half), below(centre.x + half, centre.y + half);
            for (const auto& [from, to] : {std::pair{apex, above}, {above, below}, {below, apex}})
                cv::line(picture, from, to, bgr(row.color), thin, cv::LINE_AA);
            break;
        }
        case Row::kGrid: {
            const int half = place.height * 2 / 5;
            cv::rectangle(picture, {centre.x - half, centre.y - half},
                          {centre.x + half, centre.y + half}, bgr(row.color),
                          std::max(1, cvRound(1.5 * size)), cv::LINE_AA);
            break;
        }
    }
}

/// Darkens or lightens a part of the picture towards a colour.
void draw_panel(cv::Mat& picture, const cv::Rect& panel, const Palette& colors, double size) {
    const cv::Rect inside = panel & cv::Rect(0, 0, picture.cols, picture.rows);
    cv::Mat part = picture(inside);
    const cv::Mat tint(part.size(), part.type(), bgr(colors.panel));
    cv::addWeighted(tint, 0.86, part, 0.14, 0, part);
    cv::rectangle(picture, inside, bgr(colors.grid), std::max(1, cvRound(size)));
}

/// Place for a panel in the corner where it hides least (not lower right: the scale bar's).
cv::Rect emptiest_corner(const cv::Mat& picture, const cv::Size& panel, int border,
                         const cv::Scalar& background) {
    const int right = picture.cols - border - panel.width;
    const int bottom = picture.rows - border - panel.height;
    cv::Rect best;
    int least = picture.rows * picture.cols;
    for (const cv::Point& corner :
         {cv::Point(border, border), cv::Point(right, border), cv::Point(border, bottom)}) {
        const cv::Rect place(corner, panel);
        const cv::Rect inside = place & cv::Rect(0, 0, picture.cols, picture.rows);
        if (inside != place) continue;
        cv::Mat free;
        const cv::Scalar faint = cv::Scalar::all(60);  // the grid's lines do not count
        cv::inRange(picture(place), background - faint, background + faint, free);
        const int hidden = place.area() - cv::countNonZero(free);
        if (hidden < least) {
            least = hidden;
            best = place;
        }
    }
    return best.empty() ? cv::Rect({border, border}, panel) : best;
}

void draw_scale_bar(cv::Mat& picture, double size, double pixels_per_metre, const Palette& colors) {
    // The longest of 1, 2, 5 times a power of ten that stays under a fifth of the width.
    const double limit = 0.2 * picture.cols / pixels_per_metre;
    const double power = std::pow(10, std::floor(std::log10(limit)));
    double metres = power;
    for (double factor : {2.0, 5.0})
        if (factor * power <= limit) metres = factor * power;
    char label[32];
    std::snprintf(label, sizeof(label), "%g m", metres);

    const int length = cvRound(metres * pixels_per_metre),
              thickness = std::max(1, cvRound(2 * size));
    const cv::Point right(picture.cols - cvRound(24 * size), picture.rows - cvRound(24 * size)),
        left(right.x - length, right.y), up(0, cvRound(5 * size));
    const cv::Scalar color = bgr(colors.text);
    cv::line(picture, left, right, color, thickness, cv::LINE_AA);
    cv::line(picture, left - up, left + up, color, thickness, cv::LINE_AA);
    cv::line(picture, right - up, right + up, color, thickness, cv::LINE_AA);
    int below = 0;
    const cv::Size text = cv::getTextSize(label, kFont, 0.5 * size, 1, &below);
    cv::putText(picture, label, {(left.x + right.x - text.width) / 2, right.y - cvRound(9 * size)},
                kFont, 0.5 * size, color, std::max(1, cvRound(0.6 * size)), cv::LINE_AA);
}

}  // namespace

void draw_legend(cv::Mat& picture, const mrpt::opengl::COpenGLScene& scene, double size,
                 double pixels_per_metre) {
    const bool dark = is_dark(scene);
    const Palette& colors = palette(dark);
    if (pixels_per_metre > 0) draw_scale_bar(picture, size, pixels_per_metre, colors);
    const std::vector<Row> rows = rows_of(scene);
    if (rows.empty()) return;
    int text_width = 0, below = 0;
    for (const Row& row : rows)
        text_width =
            std::max(text_width, cv::getTextSize(row.label, kFont, 0.5 * size, 1, &below).width);
    const int pad = cvRound(12 * size), line = cvRound(23 * size), mark = cvRound(30 * size);
    const cv::Rect panel = emptiest_corner(
        picture, {mark + text_width + 3 * pad, line * static_cast<int>(rows.size()) + pad},
        cvRound(16 * size), bgr(palette(dark).background));
    draw_panel(picture, panel, colors, size);
    for (size_t i = 0; i < rows.size(); ++i) {
        const int top = panel.y + pad / 2 + line * static_cast<int>(i);
        draw_mark(picture, rows[i], {panel.x + pad, top + line / 8, mark, line * 3 / 4}, size,
                  dark);
        cv::putText(picture, rows[i].label,
                    {panel.x + 2 * pad + mark, top + line / 2 + cvRound(5.5 * size)}, kFont,
                    0.5 * size, bgr(colors.text), std::max(1, cvRound(0.6 * size)), cv::LINE_AA);
    }
}

}  // namespace vio
