#include "gui_offscreen/snapshot.h"

#include <mrpt/img/CImage.h>
#include <mrpt/opengl/CFBORender.h>
#include <mrpt/opengl/CGridPlaneXY.h>
#include <mrpt/opengl/CPointCloudColoured.h>
#include <mrpt/opengl/CSetOfTriangles.h>
#include <mrpt/poses/CPose3D.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "gui_offscreen/framing.h"
#include "gui_offscreen/legend.h"
#include "libvio/base/errors.h"

namespace vio {
namespace {

using Eigen::Vector3d;
using mrpt::opengl::COpenGLScene;

constexpr double kFlatView = 0.03;         // half the field of view of top and side: near parallel
constexpr double kPerspectiveView = 0.42;  // of the others [rad]

/// What a scene holds that the picture must show.
struct SceneContent {
    std::vector<Vector3d> path;  ///< with the axes and gravity at its beginning
    std::vector<Vector3d> landmarks;
    std::optional<Pose> T_W_C;  ///< newest camera
};

Pose pose_of(const mrpt::opengl::CRenderizable& object) {
    const mrpt::math::CMatrixDouble44 T =
        mrpt::poses::CPose3D(object.getPose())
            .getHomogeneousMatrixVal<mrpt::math::CMatrixDouble44>();
    Pose pose;
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) pose.R(row, column) = T(row, column);
        pose.p[row] = T(row, 3);
    }
    return pose;
}

void add_corners(const mrpt::opengl::CRenderizable& object, std::vector<Vector3d>& points) {
    const auto box = object.getBoundingBox();
    for (int i = 0; i < 8; ++i)
        points.emplace_back(i & 1 ? box.min.x : box.max.x, i & 2 ? box.min.y : box.max.y,
                            i & 4 ? box.min.z : box.max.z);
}

SceneContent content_of(const COpenGLScene& scene) {
    SceneContent content;
    std::vector<Vector3d> everything;
    for (const auto& object : *scene.getViewport()) {
        const std::string name = object->getName();
        const auto* mesh = dynamic_cast<const mrpt::opengl::CSetOfTriangles*>(object.get());
        const auto* cloud = dynamic_cast<const mrpt::opengl::CPointCloudColoured*>(object.get());
        if (mesh && (name.starts_with("path ") || name == "world axes" || name == "gravity")) {
            mrpt::opengl::TTriangle triangle;
            for (size_t i = 0; i < mesh->getTrianglesCount(); ++i) {
                mesh->getTriangle(i, triangle);
                content.path.emplace_back(triangle.x(0), triangle.y(0), triangle.z(0));
            }
        } else if (cloud) {
            for (size_t i = 0; i < cloud->size(); ++i) {
                const auto& p = cloud->getPoint3Df(i);
                content.landmarks.emplace_back(p.x, p.y, p.z);
            }
        } else if (name == "newest camera") {
            content.T_W_C = pose_of(*object);
            add_corners(*object, content.path);
        }
        if (!dynamic_cast<const mrpt::opengl::CGridPlaneXY*>(object.get()))
            add_corners(*object, everything);
    }
    std::erase_if(everything, [](const Vector3d& p) {
        return !p.allFinite() || p.cwiseAbs().maxCoeff() > 1e6;
    });
    if (content.path.empty()) content.path = everything;
    if (content.path.empty()) content.path = {-Vector3d::Ones(), Vector3d::Ones()};
    return content;
}

CameraPlacement chase(const SceneContent& content, const ChasePoint& point,
                      const Eigen::Matrix3d& turn, int width, int height) {
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : content.path) box.extend(p);
    const double extent = point.extent > 0 ? point.extent : box.diagonal().norm();
    const double distance = 0.35 * extent;
    const Vector3d forward =
        point.forward.norm() > 1e-6 ? point.forward.normalized() : Vector3d::UnitX();
    const Vector3d offset = turn * (Vector3d(0, 0, 0.5 * distance) - distance * forward);
    CameraPlacement camera;
    camera.T_W_C.R = look_along(0.4 * distance * (turn * forward) - offset);
    camera.T_W_C.p = point.position + offset;
    camera.focal_px = 0.5 * std::max(width, height) / std::tan(1.2 * kPerspectiveView);
    camera.near_m = 0.02 * distance;
    camera.far_m = 40 * extent;
    return camera;
}

CameraPlacement place_camera(const SceneContent& content, const SnapshotOptions& options, int width,
                             int height) {
    const Eigen::Matrix3d turn = so3::exp({0, 0, options.turn});
    std::optional<ChasePoint> followed = options.chase;
    if (!followed && content.T_W_C)
        followed = ChasePoint{content.T_W_C->p, chase_direction(*content.T_W_C)};
    if (options.view == View::kChase && followed)
        return chase(content, *followed, turn, width, height);
    const auto nearby = nearby_points(content.path, content.landmarks);
    Eigen::Matrix3d R = look_along(turn * Vector3d(-0.62, 0.85, -0.72));
    if (options.view == View::kTop) R << turn.col(0), -turn.col(1), -turn.col(2);
    if (options.view == View::kSide) R = look_along(turn * Vector3d::UnitY());
    const bool flat = options.view == View::kTop || options.view == View::kSide;
    return frame_path(content.path, nearby, R, width, height, flat ? kFlatView : kPerspectiveView);
}

mrpt::opengl::CCamera converted(const CameraPlacement& placement, int width, int height,
                                int rendered_width) {
    mrpt::img::TCamera pinhole;
    pinhole.ncols = static_cast<uint32_t>(rendered_width);
    pinhole.nrows = static_cast<uint32_t>(height);
    pinhole.fx(placement.focal_px);
    pinhole.fy(placement.focal_px);
    pinhole.cx(0.5 * width);
    pinhole.cy(0.5 * height);
    mrpt::opengl::CCamera camera;
    camera.set6DOFMode(true);
    camera.setProjectiveFromPinhole(pinhole);
    camera.setPose(
        mrpt::poses::CPose3D::FromRotationAndTranslation(placement.T_W_C.R, placement.T_W_C.p));
    return camera;
}

/// Frees what the scene holds in this renderer's OpenGL context, so that another renderer can take
/// it.
void release(COpenGLScene& scene) {
    scene.freeOpenGLResources();
    scene.unloadShaders();
    for (const auto& object : *scene.getViewport()) object->notifyChange();
}

/// Point sizes are in rendered pixels: grown with the picture while this lives.
class GrownPoints {
 public:
    GrownPoints(COpenGLScene& scene, double factor) {
        for (const auto& object : *scene.getViewport())
            if (auto cloud = std::dynamic_pointer_cast<mrpt::opengl::CPointCloudColoured>(object)) {
                sizes_.emplace_back(cloud, cloud->getPointSize());
                cloud->setPointSize(static_cast<float>(factor) * cloud->getPointSize());
            }
    }
    ~GrownPoints() {
        for (auto& [cloud, size] : sizes_) cloud->setPointSize(size);
    }

 private:
    std::vector<std::pair<mrpt::opengl::CPointCloudColoured::Ptr, float>> sizes_;
};

}  // namespace

std::optional<View> parse_view(const std::string& word) {
    if (word == "top") return View::kTop;
    if (word == "side") return View::kSide;
    if (word == "iso") return View::kIso;
    if (word == "chase") return View::kChase;
    return std::nullopt;
}

Vector3d chase_direction(const Pose& T_W_C) {
    const Vector3d view(T_W_C.R(0, 2), T_W_C.R(1, 2), 0), x = T_W_C.R.col(0);
    return view.norm() > 0.1 ? view.normalized() : Vector3d(x.x(), x.y(), 0).normalized();
}

struct SnapshotRenderer::Impl {
    int width, height, supersampling;
    std::string problem;
    std::unique_ptr<mrpt::opengl::CFBORender> renderer;

    int fine_width() const { return width * supersampling; }
    int fine_height() const { return height * supersampling; }
    // The frame buffer's rows must be multiples of four pixels: the rest is cut off.
    int rendered_width() const { return (fine_width() + 3) / 4 * 4; }
};

SnapshotRenderer::SnapshotRenderer(int width, int height, int supersampling)
    : impl_(new Impl{width, height, std::max(supersampling, 1), "", nullptr}) {
    if (width < 16 || height < 16 || impl_->fine_width() > 16384 || impl_->fine_height() > 16384)
        throw InputError("a picture must measure between 16 px and " +
                         std::to_string(16384 / impl_->supersampling) + " px along each side");
    try {
        impl_->renderer = std::make_unique<mrpt::opengl::CFBORender>(
            static_cast<unsigned>(impl_->rendered_width()),
            static_cast<unsigned>(impl_->fine_height()));
    } catch (const std::exception&) {
        impl_->problem =
            "no picture: off-screen OpenGL (EGL) cannot start; install a software renderer with "
            "'apt install libegl-mesa0 libgl1-mesa-dri'";
    }
}

SnapshotRenderer::~SnapshotRenderer() = default;

const std::string& SnapshotRenderer::problem() const {
    return impl_->problem;
}

Snapshot SnapshotRenderer::render(const COpenGLScene::Ptr& scene, const SnapshotOptions& options) {
    if (!impl_->renderer) return {{}, impl_->problem};
    const int width = impl_->fine_width(), height = impl_->fine_height();
    const SceneContent content = content_of(*scene);
    const CameraPlacement placement = place_camera(content, options, width, height);
    scene->getViewport()->setViewportClipDistances(static_cast<float>(placement.near_m),
                                                   static_cast<float>(placement.far_m));
    const GrownPoints grown(*scene, impl_->supersampling * impl_->height / 720.0);
    impl_->renderer->setCamera(*scene,
                               converted(placement, width, height, impl_->rendered_width()));
    mrpt::img::CImage rendered;
    impl_->renderer->render_RGB(*scene, rendered);
    release(*scene);
    cv::Mat picture =
        rendered.asCvMat<cv::Mat>(mrpt::img::SHALLOW_COPY)(cv::Rect(0, 0, width, height)).clone();
    if (options.legend) {
        const bool flat = options.view == View::kTop || options.view == View::kSide;
        Vector3d centre = Vector3d::Zero();
        for (const Vector3d& p : content.path) centre += p / double(content.path.size());
        const double depth = (placement.T_W_C.inverse() * centre).z();
        draw_legend(picture, *scene, impl_->supersampling * std::max(impl_->height / 720.0, 0.5),
                    flat ? placement.focal_px / depth : 0);
    }
    if (impl_->supersampling > 1)
        cv::resize(picture, picture, cv::Size(impl_->width, impl_->height), 0, 0, cv::INTER_AREA);
    return {picture, ""};
}

Snapshot render_snapshot(const COpenGLScene::Ptr& scene, const SnapshotOptions& options) {
    SnapshotRenderer renderer(options.width, options.height, options.supersampling);
    return renderer.render(scene, options);
}

void save_image(const cv::Mat& image, const std::string& file) {
    bool saved = false;
    try {
        saved = cv::imwrite(file, image);
    } catch (const cv::Exception&) {
    }
    if (!saved)
        throw InputError(file +
                         ": cannot be written; check the folder, the free space and that "
                         "the name ends in .png or .jpg");
}

}  // namespace vio
