#pragma once

#include <vector>

#include "synth/cloth/dressed_body.h"

namespace mvstudio::synth {

/// What cloth is made of; distances for a person of 1.75 m.
struct ClothMaterial {
  double density_kg_m2 = 0.2;
  double stretch_m_n = 5e-4;   ///< compliance along and around, metres per newton
  double shear_m_n = 2e-2;     ///< of the diagonals
  double bend_m_n = 0.3;       ///< of bending
  double drag_hz = 1.0;        ///< air takes this share of the velocity a second
  double friction = 0.3;       ///< Coulomb's, against the body
  double clearance_m = 0.004;  ///< kept from the skin
  double layers_m = 0.006;     ///< kept between garments
};

/// A length that is kept: |x_a - x_b| = rest.
struct ClothEdge {
  int a, b;
  double rest_m, compliance_m_n;
};

/// A fold that is resisted: the distance of the middle b from the mean of a, b and c stays `rest_m` (Kelager et al., "A
/// triangle bending constraint model for position-based dynamics", VRIPHYS 2010).
struct ClothBend {
  int a, b, c;
  double rest_m, compliance_m_n;
};

/// A vertex of an outer garment that stays outside an inner one: on the far side of the plane through `inner`, whose normal
/// comes from its four neighbours in the grid.
struct ClothLayer {
  int outer, inner, left, right, up, down;
};

/// Particles and constraints of all garments; numbers are those of vertices less DressedBody::body_vertices.
struct ClothNet {
  std::vector<double> mass_kg;          // (N) of the cloth around each vertex
  std::vector<double> inverse_mass_kg;  // (N) 1/kg, 0 where pinned
  std::vector<ClothEdge> edges;         // along and around first, then diagonals
  size_t structural = 0;                // number of the former
  std::vector<ClothBend> bends;
  std::vector<ClothLayer> layers;
};

ClothNet MakeClothNet(const DressedBody& dressed, const ClothMaterial& material);

}  // namespace mvstudio::synth
