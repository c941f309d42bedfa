#pragma once

#include <string>

#include "body/fit/person_body.h"
#include "body/texture/bake.h"

namespace mvstudio::body {

/// A fitted body with its colours.
struct TexturedPerson {
  PersonBody person;
  Textures textures;
};

inline constexpr char kPersonFileName[] = "body.npz";

/// A PersonFile (body/files/person_file.h) with the extra arrays of docs/formats.md. Reading throws IoError, or FormatError
/// naming the array that is missing, of another size, or does not hold what it should.
void WritePerson(const TexturedPerson& person, const std::string& path);
TexturedPerson ReadPerson(const std::string& path);

}  // namespace mvstudio::body
