#include "gui_offscreen/mesh.h"

#include <cmath>

namespace vio::mesh {
namespace {

using Eigen::Vector3d;

struct Vertex {
    Vector3d point, normal;
};

mrpt::opengl::TTriangle::Vertex converted(const Vertex& v, const TColor& color) {
    mrpt::opengl::TTriangle::Vertex out;
    out.xyzrgba.pt = {static_cast<float>(v.point.x()), static_cast<float>(v.point.y()),
                      static_cast<float>(v.point.z())};
    out.normal = {static_cast<float>(v.normal.x()), static_cast<float>(v.normal.y()),
                  static_cast<float>(v.normal.z())};
    out.setColor(color);
    return out;
}

void add(CSetOfTriangles& mesh, const Vertex& a, const Vertex& b, const Vertex& c,
         const TColor& color) {
    mrpt::opengl::TTriangle triangle;
    triangle.vertices = {converted(a, color), converted(b, color), converted(c, color)};
    mesh.insertTriangle(triangle);
}

void add_quad(CSetOfTriangles& mesh, const Vertex& a, const Vertex& b, const Vertex& c,
              const Vertex& d, const TColor& color) {
    add(mesh, a, b, c, color);
    add(mesh, a, c, d, color);
}

Vector3d perpendicular(const Vector3d& direction) {
    return direction.unitOrthogonal();
}

/// Circle around a point, in the plane normal to `direction`; `side` is where it begins.
std::vector<Vertex> ring(const Vector3d& centre, const Vector3d& direction, const Vector3d& side,
                         double radius, int sides) {
    std::vector<Vertex> vertices;
    const Vector3d other = direction.cross(side);
    for (int i = 0; i < sides; ++i) {
        const double angle = 2 * M_PI * i / sides;
        const Vector3d normal = std::cos(angle) * side + std::sin(angle) * other;
        vertices.push_back({centre + radius * normal, normal});
    }
    return vertices;
}

/// Closes the end of a tube.
void add_cap(CSetOfTriangles& mesh, const std::vector<Vertex>& rim, const Vector3d& centre,
             const Vector3d& normal, const TColor& color) {
    for (size_t i = 0; i < rim.size(); ++i) {
        const Vector3d &a = rim[i].point, &b = rim[(i + 1) % rim.size()].point;
        add(mesh, {centre, normal}, {a, normal}, {b, normal}, color);
    }
}

}  // namespace

void add_tube(CSetOfTriangles& mesh, const std::vector<Vector3d>& points, double radius,
              const TColor& color, int sides) {
    if (points.size() < 2) return;
    Vector3d side = perpendicular((points[1] - points[0]).normalized());
    std::vector<Vertex> before;
    for (size_t i = 0; i < points.size(); ++i) {
        const Vector3d in = (points[i] - points[i > 0 ? i - 1 : 0]).normalized();
        const Vector3d out = (points[i + 1 < points.size() ? i + 1 : i] - points[i]).normalized();
        Vector3d direction = in + out;  // zero vectors at the ends leave the other one
        if (direction.norm() < 1e-6) direction = in;
        direction.normalize();
        // The side is carried along with as little twist as possible.
        side -= side.dot(direction) * direction;
        side = side.norm() > 1e-6 ? side.normalized() : perpendicular(direction);
        std::vector<Vertex> now = ring(points[i], direction, side, radius, sides);
        for (size_t k = 0; i > 0 && k < now.size(); ++k) {
            const size_t next = (k + 1) % now.size();
            add_quad(mesh, before[k], before[next], now[next], now[k], color);
        }
        if (i == 0 || i + 1 == points.size())
            add_cap(mesh, now, points[i], i == 0 ? -direction : direction, color);
        before = std::move(now);
    }
}

void add_cone(CSetOfTriangles& mesh, const Vector3d& base, const Vector3d& tip, double radius,
              const TColor& color, int sides) {
    const Vector3d direction = (tip - base).normalized();
    const auto rim = ring(base, direction, perpendicular(direction), radius, sides);
    for (size_t i = 0; i < rim.size(); ++i) {
        const Vertex &a = rim[i], &b = rim[(i + 1) % rim.size()];
        add(mesh, a, b, {tip, (a.normal + b.normal).normalized()}, color);
    }
    add_cap(mesh, rim, base, -direction, color);
}

void add_ellipsoid(CSetOfTriangles& mesh, const Vector3d& centre, const Eigen::Matrix3d& A,
                   const TColor& color) {
    constexpr int kRows = 10, kColumns = 20;
    const auto vertex = [&](int row, int column) -> Vertex {
        const double latitude = M_PI * row / kRows, longitude = 2 * M_PI * column / kColumns;
        const Vector3d unit(std::sin(latitude) * std::cos(longitude),
                            std::sin(latitude) * std::sin(longitude), std::cos(latitude));
        // Normals go with the cofactor matrix, which exists for a flat ellipsoid too.
        Eigen::Matrix3d cofactors;
        cofactors << A.col(1).cross(A.col(2)), A.col(2).cross(A.col(0)), A.col(0).cross(A.col(1));
        return {centre + A * unit, (cofactors * unit).normalized()};
    };
    for (int row = 0; row < kRows; ++row)
        for (int column = 0; column < kColumns; ++column)
            add_quad(mesh, vertex(row, column), vertex(row, column + 1),
                     vertex(row + 1, column + 1), vertex(row + 1, column), color);
}

void add_triangle(CSetOfTriangles& mesh, const Vector3d& a, const Vector3d& b, const Vector3d& c,
                  const TColor& color) {
    const Vector3d normal = (b - a).cross(c - a).normalized();
    add(mesh, {a, normal}, {b, normal}, {c, normal}, color);
}

}  // namespace vio::mesh
