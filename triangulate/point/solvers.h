#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "triangulate/point/linear.h"
#include "triangulate/point/point.h"

/// All solvers for one point from the rays or pixels of its views, behind one interface. They use all given views:
/// TriangulatePoint selects views. Coordinates are `local` (see PreparedRig), which keeps the precision of rigs far from
/// the world's origin. All need 2 views and different centres.
namespace mvstudio::triangulate {

enum class Solver {
  kMidpoint,           ///< "midpoint"
  kDlt,                ///< "dlt"
  kLeastSquares,       ///< "least-squares"
  kLinear,             ///< "linear"
  kLost,               ///< "lost"
  kMid2,               ///< "mid2"; two views
  kWmid2,              ///< "wmid2"; two views
  kL1,                 ///< "l1"; two views
  kLinf,               ///< "linf"; two views
  kMaximumLikelihood,  ///< "all-views"
};

inline constexpr Solver kAllSolvers[] = {
    Solver::kMidpoint, Solver::kDlt,   Solver::kLeastSquares, Solver::kLinear, Solver::kLost,
    Solver::kMid2,     Solver::kWmid2, Solver::kL1,           Solver::kLinf,   Solver::kMaximumLikelihood};

std::string_view ToString(Solver solver);
std::optional<Solver> SolverFromString(std::string_view name);
/// True for the closed forms of Lee and Civera. Given more views, they use the pair of largest ParallaxSignificance.
bool IsTwoView(Solver solver);

LinearPoint Solve(Solver solver, const std::vector<View>& views);

/// The solver behind a method; maximum likelihood for kRobust and kAllViews.
Solver SolverOf(PointMethod method);

/// Homogeneous direct linear transformation: the right singular vector of the smallest singular value of the rows x P3 - z
/// P1, y P3 - z P2 of every view. (x, y, z) is its ray and P = [R | t] its camera, undistorted (Hartley and Zisserman,
/// "Multiple View Geometry", 2nd ed., 12.2). By SVD of the rows, never of A^T A. kDegenerate: rank below 3, or a point at
/// infinity.
LinearPoint HomogeneousDlt(const std::vector<View>& views);

/// The same rows with the last coordinate fixed to 1, solved by QR (Hartley and Sturm, "Triangulation", CVIU 1997,
/// Linear-LS).
LinearPoint InhomogeneousLeastSquares(const std::vector<View>& views);

/// Linear optimal sine triangulation (Henry and Christian, "Absolute triangulation algorithms for space exploration", JGCD
/// 2023, arXiv 2205.12197). Each view's rows are divided by its noise, here the detection's sigma propagated through the
/// lens, and by its range. The law of sines gives the range from the rays of two views, gamma_i = |d_ij x a_j| / |a_i x
/// a_j|; the partner j is the view of largest parallax. The maximum-likelihood point to first order, without iteration.
LinearPoint Lost(const std::vector<View>& views);

/// Midpoint of the points at the ranges that the law of sines gives on both rays. Unlike the midpoint of the common
/// perpendicular, it is not biased towards the cameras at low parallax (Lee and Civera, "Triangulation: why optimize?",
/// BMVC 2019, arXiv 1907.11917). kBehindCamera when the points with the opposite sign of a range lie closer together.
LinearPoint Mid2(const View& a, const View& b);
/// The same points weighted by their inverse ranges (same paper).
LinearPoint InverseDepthWeightedMid2(const View& a, const View& b);

/// Least sum, and least maximum, of the two angles by which the rays must be rotated to intersect (Lee and Civera,
/// "Closed-form optimal two-view triangulation based on angular errors", ICCV 2019, arXiv 1903.09115). kBehindCamera when
/// they intersect behind a centre.
LinearPoint L1Angular(const View& a, const View& b);
LinearPoint LinfAngular(const View& a, const View& b);

/// Maximum likelihood for Gaussian pixel noise: Refine from Lost, or from Midpoint where Lost fails. Status as in
/// Refinement.
LinearPoint MaximumLikelihood(const std::vector<View>& views);

}  // namespace mvstudio::triangulate
