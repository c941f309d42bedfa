#pragma once

#include <string>
#include <vector>

#include "avatar/body/files/textured_person.h"
#include "core/image.h"
#include "stages/result.h"

/// A fitted body changed by hand.
namespace mvstudio::stages {

/// What was changed.
struct BodyEdit {
  int charts_changed = 0;
  int64_t texels_changed = 0;  ///< where the charts keep their size, else all
  std::vector<std::string> shapes;
  double mean_move_m = 0, most_move_m = 0;  ///< of the vertices at rest
};

/// Takes the colours of an atlas (texture.png of a body's folder, edited). `place` is for messages. Throws FormatError
/// unless it holds charts of the body's size, or of a multiple of it.
void EditTexture(const Image& atlas, const std::string& place, body::TexturedPerson* person, BodyEdit* edit);

/// Adds to the shape: `text` is NAME=VALUE,…. trunk, head, arm and leg are girths, 0.1 for a tenth thicker; the others are the
/// blend shapes of `body_template` (as `avatar fit` takes it; empty: none), in its coefficients, and act on the fitted body
/// with its offsets. Throws UsageError for what is no such list, unknown names, which lists those that are known, and a
/// template of another surface.
void EditShape(const std::string& text, const std::string& body_template, body::TexturedPerson* person, BodyEdit* edit);

nlohmann::ordered_json ToJson(const BodyEdit& edit);
std::string ToTable(const BodyEdit& edit);

}  // namespace mvstudio::stages
