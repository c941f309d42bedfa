#pragma once

#include "avatar/body/body_template.h"
#include "avatar/splats/cloud.h"

/// What Gaussians change with the turns of the bones that they hang on, beside moving with their triangles: a linear corrective
/// of offset, opacity and colour.
namespace mvstudio::splats {

/// Turn of each bone against its parent, as a rotation vector in the frame at rest, radians (3, B); that of a root is 0.
/// Rotations of bones are fitted to the posed mesh itself: to the vertices that the bone moves most, weighted by their skin
/// weights (Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta Cryst. 1976). Bones whose vertices
/// fix no rotation, or are not finite, turn with their parents.
Eigen::Matrix3Xf BoneTurns(const body::BodyTemplate& body, const Eigen::Matrix3Xf& vertices);

/// For each face the two bones that move it most, by the sum of its corners' weights; -1: none. (2, F)
Eigen::Matrix2Xi BonesOfFaces(const body::BodyTemplate& body);

/// One posed body, for clouds on it.
template <class S>
struct Bending {
  const Eigen::Matrix2Xi& bones;              // BonesOfFaces
  Eigen::Matrix<S, 3, Eigen::Dynamic> turns;  // BoneTurns
};

/// Units of the coefficients: what one of them adds for a turn of one radian.
inline constexpr double kBendOffset = 0.01;  ///< metres along the normal
inline constexpr double kBendOpacity = 1;    ///< logit
inline constexpr double kBendColour = 0.25;  ///< coefficients of degree 0

/// The cloud in a pose: one without corrective that looks as this one does there. Itself where it has none.
template <class S>
BasicCloud<S> Bent(const BasicCloud<S>& cloud, const Bending<S>& bending);

/// Adds to `out` (of the cloud with its corrective) the gradient that belongs to the gradient `by_bent` of the bent cloud.
template <class S>
void AddBendGradient(const BasicCloud<S>& cloud, const Bending<S>& bending, const Parameters<S>& by_bent, Parameters<S>* out);

extern template BasicCloud<float> Bent(const BasicCloud<float>&, const Bending<float>&);
extern template BasicCloud<double> Bent(const BasicCloud<double>&, const Bending<double>&);
extern template void AddBendGradient(const BasicCloud<float>&, const Bending<float>&, const Parameters<float>&,
                                     Parameters<float>*);
extern template void AddBendGradient(const BasicCloud<double>&, const Bending<double>&, const Parameters<double>&,
                                     Parameters<double>*);

}  // namespace mvstudio::splats
