#pragma once

#include <array>
#include <string>
#include <vector>

#include "avatar/body/fit/person_body.h"
#include "avatar/body/texture/bake.h"

namespace mvstudio::body {

/// A fitted body with its colours, and the images that both were fitted to.
struct TexturedPerson {
  PersonBody person;
  Textures textures;
  std::vector<std::array<int, 2>> cameras;  ///< Panoptic's panel and node; empty: not known
  std::vector<int> frames;                  ///< `person.seen` can hold more, which were only posed
  /// (V) metres: where the surface lies off the template's along its normals, and the standard deviations; empty: not known.
  Eigen::VectorXd offset_m, offset_sigma_m;
};

inline constexpr char kPersonFileName[] = "body.npz";

/// A PersonFile (avatar/body/files/person_file.h) with the extra arrays of docs/formats.md. Reading throws IoError, or
/// FormatError naming the array that is missing, of another size, or does not hold what it should.
void WritePerson(const TexturedPerson& person, const std::string& path);
TexturedPerson ReadPerson(const std::string& path);

}  // namespace mvstudio::body
