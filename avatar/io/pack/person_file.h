#pragma once

#include <string>

#include "body/fit/person_body.h"
#include "body/texture/bake.h"

namespace mvstudio::avatar {

/// A fitted body with its colours: RUN/body.safetensors, docs/formats.md.
struct TexturedPerson {
  body::PersonBody person;
  body::Textures textures;
};

inline constexpr char kPersonFile[] = "body.safetensors";
inline constexpr char kPersonSchema[] = "mvstudio.person-body/1";

void WritePerson(const TexturedPerson& person, const std::string& path);
/// Throws IoError, or FormatError naming the tensor: sizes, indices, weights and bones are checked.
TexturedPerson ReadPerson(const std::string& path);

}  // namespace mvstudio::avatar
