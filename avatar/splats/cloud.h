#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

/// Gaussians on the triangles of a posed body: the parameters, shared by everything else here. Functions come in float, for
/// images and training, and in double, against which the gradients are checked.
namespace mvstudio::splats {

inline constexpr int kMaxDegree = 2;
/// The corrective of poses (bend.h): two bones, three axes of their turns, five numbers that change.
inline constexpr int kBendBones = 2, kBendKinds = 5, kBendSize = kBendBones * 3 * kBendKinds;
/// Spherical harmonics up to a degree.
constexpr int BasisSize(int degree) { return (degree + 1) * (degree + 1); }

/// What is learned of N Gaussians, one array a kind: their values, or gradients, or an optimiser's moments. Frame `face`: of a
/// triangle with corners x0, x1, x2 the axes are x1 - x0, the normal times that, and the normal, all of unit length.
template <class S>
struct Parameters {
  int degree = 0;            ///< of the colour, 0..2
  std::vector<S> place;      ///< (N, 2) barycentric weights of x1 and x2; that of x0 is 1 minus both
  std::vector<S> offset;     ///< (N) metres along the normal
  std::vector<S> log_scale;  ///< (N, 3) logarithms of the standard deviations along its own axes, metres
  std::vector<S> rotation;   ///< (N, 4) x, y, z, w of face_from_own; of any length but 0
  std::vector<S> opacity;    ///< (N) logit
  std::vector<S> colour;     ///< (N, BasisSize(degree), 3) coefficients of R, G, B; 0: grey 0.5 (colour.h)
  bool bends = false;        ///< whether there is a corrective of poses
  std::vector<S> bend;       ///< (N, 2 bones, 3 axes, 5) its coefficients, bend.h; empty without one

  size_t size() const { return offset.size(); }
};

enum class Group { kPlace, kOffset, kScale, kRotation, kOpacity, kColour, kBend };

/// Calls `visit(group, numbers a Gaussian, array)` for each array.
template <class P, class Visitor>
void ForEachGroup(P& p, Visitor&& visit) {
  visit(Group::kPlace, 2, p.place);
  visit(Group::kOffset, 1, p.offset);
  visit(Group::kScale, 3, p.log_scale);
  visit(Group::kRotation, 4, p.rotation);
  visit(Group::kOpacity, 1, p.opacity);
  visit(Group::kColour, 3 * BasisSize(p.degree), p.colour);
  if (p.bends) visit(Group::kBend, kBendSize, p.bend);
}

/// N Gaussians of this degree, with a corrective of poses or without, all numbers 0.
template <class S>
Parameters<S> ZeroParameters(size_t n, int degree, bool bends = false) {
  Parameters<S> p;
  p.degree = degree, p.bends = bends;
  ForEachGroup(p, [n](Group, int width, std::vector<S>& array) { array.assign(n * static_cast<size_t>(width), S(0)); });
  return p;
}

template <class S>
struct BasicCloud {
  std::vector<int> face;  ///< (N) index of the triangle
  Parameters<S> values;
  /// (N) m^2, added to every variance: the 3D smoothing filter of Mip-Splatting (density.h); 0: none.
  std::vector<S> filter_variance;

  size_t size() const { return face.size(); }
};
using Cloud = BasicCloud<float>;

/// Throws ContractViolation where the arrays' lengths do not match, or a face does not exist.
template <class S>
void CheckCloud(const BasicCloud<S>& cloud, int num_faces);
extern template void CheckCloud(const BasicCloud<float>&, int);
extern template void CheckCloud(const BasicCloud<double>&, int);

/// The same Gaussians in another precision.
template <class To, class From>
BasicCloud<To> CloudCast(const BasicCloud<From>& from) {
  BasicCloud<To> to;
  to.face = from.face;
  to.filter_variance.assign(from.filter_variance.begin(), from.filter_variance.end());
  to.values = ZeroParameters<To>(from.size(), from.values.degree, from.values.bends);
  std::vector<const std::vector<From>*> arrays;
  ForEachGroup(from.values, [&](Group, int, const std::vector<From>& array) { arrays.push_back(&array); });
  size_t i = 0;
  ForEachGroup(to.values, [&](Group, int, std::vector<To>& array) {
    array.assign(arrays[i]->begin(), arrays[i]->end());
    ++i;
  });
  return to;
}

/// The Gaussians at `indices`, in that order.
Cloud Select(const Cloud& cloud, const std::vector<size_t>& indices);
/// The same for values of any kind.
Parameters<float> Select(const Parameters<float>& values, const std::vector<size_t>& indices);

}  // namespace mvstudio::splats
