#include "stages/surface/describe.h"

#include <cmath>
#include <vector>

#include "core/format.h"
#include "core/units.h"
#include "triangulate/budget/reliability.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

/// Means over a set of frames; NaN of none.
struct Means {
  int frames = 0, failed = 0;
  double chamfer_cm = NAN, to_cm = NAN, to_p95_cm = NAN, from_cm = NAN, from_p95_cm = NAN, normal_deg = NAN;
  double vertices_cm = NAN, procrustes_cm = NAN, canonical_cm = NAN;
};

/// Mean of what `value` gives of the scores, without NaN.
template <class Value>
double MeanOf(const std::vector<const body::BodyScore*>& scores, const Value& value) {
  double sum = 0;
  int count = 0;
  for (const body::BodyScore* score : scores) {
    const double x = value(*score);
    if (std::isfinite(x)) sum += x, ++count;
  }
  return count > 0 ? sum / count : NAN;
}

Means MeansOf(const std::vector<const body::BodyScore*>& all) {
  Means m;
  std::vector<const body::BodyScore*> scores;
  for (const body::BodyScore* score : all) {
    if (score->surface.status == Status::kOk) scores.push_back(score);
  }
  m.frames = static_cast<int>(scores.size()), m.failed = static_cast<int>(all.size() - scores.size());
  using Score = body::BodyScore;
  m.chamfer_cm = 100 * MeanOf(scores, [](const Score& s) { return s.surface.chamfer_m(); });
  m.to_cm = 100 * MeanOf(scores, [](const Score& s) { return s.surface.to_truth.mean_m; });
  m.to_p95_cm = 100 * MeanOf(scores, [](const Score& s) { return s.surface.to_truth.p95_m; });
  m.from_cm = 100 * MeanOf(scores, [](const Score& s) { return s.surface.from_truth.mean_m; });
  m.from_p95_cm = 100 * MeanOf(scores, [](const Score& s) { return s.surface.from_truth.p95_m; });
  m.normal_deg = RadToDeg(MeanOf(scores, [](const Score& s) { return s.surface.normal_rad(); }));
  m.vertices_cm = 100 * MeanOf(scores, [](const Score& s) { return s.vertices ? s.vertices->mean_m : NAN; });
  m.procrustes_cm = 100 * MeanOf(scores, [](const Score& s) { return s.vertices ? s.vertices->procrustes_m : NAN; });
  m.canonical_cm = 100 * MeanOf(scores, [](const Score& s) { return s.canonical_m.value_or(NAN); });
  return m;
}

ordered_json ToJson(const Means& m) {
  return {{"frames", m.frames},
          {"failed", m.failed},
          {"mve_cm", FiniteOrNull(m.vertices_cm)},
          {"mve_procrustes_cm", FiniteOrNull(m.procrustes_cm)},
          {"mve_canonical_cm", FiniteOrNull(m.canonical_cm)},
          {"chamfer_cm", FiniteOrNull(m.chamfer_cm)},
          {"to_truth_cm", FiniteOrNull(m.to_cm)},
          {"to_truth_p95_cm", FiniteOrNull(m.to_p95_cm)},
          {"from_truth_cm", FiniteOrNull(m.from_cm)},
          {"from_truth_p95_cm", FiniteOrNull(m.from_p95_cm)},
          {"normal_deg", FiniteOrNull(m.normal_deg)}};
}

std::string Cell(double value) { return std::isfinite(value) ? Format("%7.2f", value) : "      -"; }

std::string Row(const std::string& path, const std::string& set, const Means& m) {
  std::string row = Format("%-28s %-7s %6d", path.size() > 28 ? ("…" + path.substr(path.size() - 27)).c_str() : path.c_str(),
                           set.c_str(), m.frames);
  for (const double value : {m.vertices_cm, m.procrustes_cm, m.canonical_cm, m.chamfer_cm, m.to_cm, m.to_p95_cm, m.from_cm,
                             m.from_p95_cm, m.normal_deg})
    row += " " + Cell(value);
  return row + "\n";
}

std::string SurfaceTableHead() {
  std::string head = Format("%-28s %-7s %6s", "body", "set", "frames");
  for (const char* name : {"MVE", "PA-MVE", "canon.", "chamfer", "to", "95 %", "from", "95 %", "normal"})
    head += Format(" %7s", name);
  return head + "\n" + Format("%-43s", "") + "      cm      cm      cm      cm      cm      cm      cm      cm     deg\n";
}

/// Whether the standard deviations of the surface are true, vertex by vertex.
std::string AddReliability(const std::vector<double>& whitened, ordered_json* body) {
  if (whitened.empty()) return "";
  const triangulate::Reliability is = triangulate::MeasureReliability(whitened, 1);
  (*body)["reliability"] = {{"num", is.num},
                            {"expected_calibration_error", is.error},
                            {"sigma_factor", is.sigma_factor},
                            {"stated", is.stated},
                            {"observed", is.observed}};
  return Format("  its sigmas: calibration error %.3f over %d vertices, should grow by %.2f\n", is.error, is.num,
                is.sigma_factor);
}

CommandResult DescribeBody(const std::string& path, const body::BodyScores& scores) {
  CommandResult result;
  ordered_json& body = result.metrics;
  body = {{"body", path},
          {"mesh", scores.mesh.empty() ? ordered_json(nullptr) : ordered_json(scores.mesh)},
          {"axes", std::string(ToString(scores.axes))},
          {"sigma_z", scores.sigma_z ? FiniteOrNull(*scores.sigma_z) : ordered_json(nullptr)}};
  int failed = 0;
  for (const char* set : {"fitted", "other", "all"}) {
    std::vector<const body::BodyScore*> chosen;
    for (const body::BodyScore& score : scores.frames) {
      if (std::string(set) == "all" || score.fitted == (std::string(set) == "fitted")) chosen.push_back(&score);
    }
    if (chosen.empty()) continue;
    const Means means = MeansOf(chosen);
    failed = means.failed;  // of all, the last
    body[set] = ToJson(means);
    result.text += Row(path, set, means);
  }
  result.text += AddReliability(scores.whitened, &body);
  if (scores.frames.empty()) {
    result.exit = kExitBadInput;
    result.errors.push_back({"SUR-NO-FRAME", path + " has no pose in a frame whose surface is known",
                             "give the truth of the take that the body was fitted to"});
  } else if (failed > 0) {
    result.exit = kExitPartial;
    result.warnings.push_back({"SUR-FAILED",
                               Format("%s: %d of %zu frames have no score; a surface is not finite or has no area",
                                      path.c_str(), failed, scores.frames.size()),
                               "check the truth's vertices and the body's poses"});
  }
  return result;
}

}  // namespace

CommandResult Describe(const SurfaceReport& report) {
  CommandResult result;
  result.inputs = report.options.bodies;
  result.inputs.push_back(report.options.truth);
  ordered_json bodies = ordered_json::array();
  for (size_t i = 0; i < report.scores.size(); ++i) {
    CommandResult body = DescribeBody(report.options.bodies[i], report.scores[i]);
    bodies.push_back(std::move(body.metrics));
    body.metrics = ordered_json::object();
    if (body.exit == kExitPartial && result.exit != kExitOk) body.exit = result.exit;
    result.Add(std::move(body));
  }
  result.metrics["bodies"] = std::move(bodies);
  if (!result.text.empty()) result.text = SurfaceTableHead() + result.text;
  return result;
}

}  // namespace mvstudio::stages
