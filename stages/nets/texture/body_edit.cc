#include "stages/nets/texture/body_edit.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>

#include "avatar/body/files/atlas.h"
#include "avatar/body/templates/read.h"
#include "avatar/run/pack/body_shape.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"

namespace mvstudio::stages {
namespace {

const std::map<std::string, avatar::GirthGroup>& Girths() {
  static const std::map<std::string, avatar::GirthGroup> girths = {
      {"trunk", avatar::kTrunkGirth}, {"head", avatar::kHeadGirth}, {"arm", avatar::kArmGirth}, {"leg", avatar::kLegGirth}};
  return girths;
}

/// "height=+2,weight=-1"; names may hold anything but commas and '='.
std::vector<std::pair<std::string, double>> ParseShape(const std::string& text) {
  std::vector<std::pair<std::string, double>> changes;
  std::set<std::string> names;
  for (const std::string& part : SplitCommas(text)) {
    const size_t equals = part.find('=');
    const std::string name = part.substr(0, equals), number = equals == std::string::npos ? "" : part.substr(equals + 1);
    char* end = nullptr;
    const double value = std::strtod(number.c_str(), &end);
    if (name.empty() || number.empty() || *end != '\0' || !(std::abs(value) <= 100))
      throw UsageError("option 'shape' " + part + ": must be NAME=NUMBER, e.g. trunk=0.1,leg=-0.05, within 100");
    if (!names.insert(name).second) throw UsageError("option 'shape' names " + name + " twice");
    changes.emplace_back(name, value);
  }
  if (changes.empty()) throw UsageError("option 'shape' is empty: it must be NAME=NUMBER,…");
  return changes;
}

/// The template's blend shapes on the fitted body.
body::BlendShapes ShapesFor(const body::BodyTemplate& body, const std::string& body_template) {
  if (body_template.empty()) return {};
  const body::BodyTemplate from = body::ReadTemplate(body_template);
  if (from.faces.cols() != body.faces.cols() || from.faces != body.faces || from.bone_names != body.bone_names)
    throw UsageError("option 'template' " + body_template +
                     ": the body was fitted to another template; give the one of its `avatar fit`");
  return from.shapes;
}

[[noreturn]] void RefuseName(const std::string& name, const body::BlendShapes& shapes, const std::string& body_template) {
  std::string text = "option 'shape' " + name + ": no such shape; girths are trunk, head, arm and leg";
  if (!shapes.names.empty()) text += "; shapes of " + body_template + " are " + Join(shapes.names, ", ");
  if (shapes.names.empty() && !body_template.empty()) text += "; " + body_template + " has no shapes";
  if (body_template.empty()) text += "; blend shapes need option 'template'";
  throw UsageError(text);
}

void RequireProper(const body::BodyTemplate& body) {
  if (!body.vertices.allFinite() || !body.bone_heads.allFinite() || !(body.vertices.cwiseAbs().maxCoeff() < 10))
    throw UsageError("option 'shape' leads out of what a body can be: give smaller numbers");
}

}  // namespace

void EditTexture(const Image& atlas, const std::string& place, body::TexturedPerson* person, BodyEdit* edit) {
  const auto charts = body::ChartsOfAtlas(atlas);
  const int chart_px = person->textures[0].width;
  if (!charts || (*charts)[0].width % chart_px != 0) {
    const int size = body::AtlasSizePx(chart_px);
    throw FormatError(place, "",
                      Format("is %d x %d px; the texture of this body is %d x %d px, as its texture.png: keep its size",
                             atlas.width, atlas.height, size, size));
  }
  for (size_t k = 0; k < charts->size(); ++k) {
    const std::vector<uint8_t>&before = person->textures[k].pixels, &after = (*charts)[k].pixels;
    if (before == after) continue;
    ++edit->charts_changed;
    for (size_t t = 0; t + 2 < after.size(); t += 3)
      edit->texels_changed += before.size() != after.size() || !std::equal(&after[t], &after[t] + 3, &before[t]);
  }
  person->textures = *charts;
}

void EditShape(const std::string& text, const std::string& body_template, body::TexturedPerson* person, BodyEdit* edit) {
  body::BodyTemplate& body = person->person.body;
  const Eigen::Matrix3Xf before = body.vertices;
  const body::BlendShapes shapes = ShapesFor(body, body_template);
  avatar::BodyShape girths;
  Eigen::VectorXd coefficients = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(shapes.names.size()));
  for (const auto& [name, value] : ParseShape(text)) {
    const auto girth = Girths().find(name);
    const auto shape = std::find(shapes.names.begin(), shapes.names.end(), name);
    if (shape != shapes.names.end()) {
      coefficients[shape - shapes.names.begin()] = value;
    } else if (girth != Girths().end()) {
      if (!(std::abs(value) <= 0.9)) throw UsageError("option 'shape' " + name + ": a girth changes by -0.9 to 0.9");
      girths.girth[static_cast<size_t>(girth->second)] = 1 + value;
    } else {
      RefuseName(name, shapes, body_template);
    }
    edit->shapes.push_back(Format("%s%+g", name.c_str(), value));
  }
  body.shapes = shapes;
  body = avatar::ScaleGirth(WithShape(body, coefficients), girths);
  body.shapes = {};
  RequireProper(body);
  const Eigen::VectorXf moves = (body.vertices - before).colwise().norm();
  edit->mean_move_m = moves.mean(), edit->most_move_m = moves.maxCoeff();
}

nlohmann::ordered_json ToJson(const BodyEdit& edit) {
  return {{"charts_changed", edit.charts_changed},
          {"texels_changed", edit.texels_changed},
          {"shapes", edit.shapes},
          {"mean_move_mm", 1e3 * edit.mean_move_m},
          {"most_move_mm", 1e3 * edit.most_move_m}};
}

std::string ToTable(const BodyEdit& edit) {
  std::string text =
      Format("%lld texels of %d charts changed\n", static_cast<long long>(edit.texels_changed), edit.charts_changed);
  if (!edit.shapes.empty())
    text += Format("shape %s: vertices moved by %.1f mm in the mean, %.1f at most\n", Join(edit.shapes, ", ").c_str(),
                   1e3 * edit.mean_move_m, 1e3 * edit.most_move_m);
  return text;
}

}  // namespace mvstudio::stages
