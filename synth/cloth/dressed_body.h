#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "avatar/body/body_template.h"

namespace mvstudio::synth {

/// A piece of cloth around the body: a grid of `rows` rings of `columns` vertices each, from the top down. The vertex of row r
/// and column c is number first + r * columns + c of the surface; columns run counter-clockwise seen from above, from x > 0.
struct Garment {
  std::string name;  // "skirt", "shirt"
  int first = 0, columns = 0, rows = 0;
  int pinned_rows = 0;  // the uppermost rings, which skinning moves

  int vertices() const { return columns * rows; }
  int At(int row, int column) const { return first + row * columns + (column % columns + columns) % columns; }
};

/// A body in a skirt and a shirt with a loose hem, as one surface whose topology does not change: the body's vertices and faces
/// first, then those of the garments. Garments lie around the rest pose as they were
/// cut.
struct DressedBody {
  body::BodyTemplate naked;
  body::BodyTemplate
      surface;  // without shapes and pose directions; skin weights of cloth are those of the body beneath, smoothed
  int body_vertices = 0, body_faces = 0;
  double scale = 1;               // the body's size over that of a person of 1.75 m
  std::vector<Garment> garments;  // the outer one last
  std::vector<uint8_t> covered;   // (V) 1: a vertex of the body that cloth hides at rest
};

/// How the garments are cut, for a person of 1.75 m; lengths grow with the body.
struct Cut {
  double spacing_m = 0.02;    ///< between rings
  int columns = 96;           ///< a multiple of 4
  double skirt_flare = 0.36;  ///< growth of the radius per metre downwards
  double shirt_flare = 0.24;  ///< the same of the hem
  double unevenness = 0.025;  ///< relative, of the radius: where folds begin
  uint64_t seed = 1;          ///< of the unevenness, and of a tenth of the flares and lengths
};

/// Dresses a body whose roles are complete (avatar/body/role_bones.h). Throws UsageError where it has no trunk and thighs to
/// hang garments on.
DressedBody Dress(const body::BodyTemplate& body, const Cut& cut);

}  // namespace mvstudio::synth
