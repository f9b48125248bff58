// Solid shapes as triangles: what lines and ellipsoids are drawn with.
#pragma once

#include <mrpt/img/TColor.h>
#include <mrpt/opengl/CSetOfTriangles.h>

#include <Eigen/Dense>
#include <vector>

namespace vio::mesh {

using mrpt::img::TColor;
using mrpt::opengl::CSetOfTriangles;

/// Round tube through the points (two or more, consecutive ones distinct) [m].
void add_tube(CSetOfTriangles& mesh, const std::vector<Eigen::Vector3d>& points, double radius,
              const TColor& color, int sides = 8);

/// Cone from the centre of its base to its tip.
void add_cone(CSetOfTriangles& mesh, const Eigen::Vector3d& base, const Eigen::Vector3d& tip,
              double radius, const TColor& color, int sides = 24);

/// Image of the unit sphere under p = centre + A x.
void add_ellipsoid(CSetOfTriangles& mesh, const Eigen::Vector3d& centre, const Eigen::Matrix3d& A,
                   const TColor& color);

/// Flat triangle, visible from both sides.
void add_triangle(CSetOfTriangles& mesh, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                  const Eigen::Vector3d& c, const TColor& color);

}  // namespace vio::mesh
