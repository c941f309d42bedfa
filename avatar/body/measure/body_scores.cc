#include "avatar/body/measure/body_scores.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/parallel.h"
#include "geometry/rig/alignment.h"

namespace mvstudio::body {
namespace {

constexpr ChoiceWords<WorldAxes, 3> kAxes = {
    {{WorldAxes::kAuto, "auto"}, {WorldAxes::kZUp, "z-up"}, {WorldAxes::kYDown, "y-down"}}};

using Meshes = std::vector<Eigen::Matrix3Xd>;

Eigen::Matrix3Xd FromYDown(const Eigen::Matrix3Xd& x) {
  Eigen::Matrix3Xd out(3, x.cols());
  out << x.row(0), x.row(2), -x.row(1);
  return out;
}

Eigen::Matrix3Xd Chosen(const Eigen::Matrix3Xd& x, const std::vector<int>& columns) {
  Eigen::Matrix3Xd chosen(3, static_cast<Eigen::Index>(columns.size()));
  for (size_t i = 0; i < columns.size(); ++i) chosen.col(static_cast<Eigen::Index>(i)) = x.col(columns[i]);
  return chosen;
}

Eigen::Vector3d Middle(const Eigen::Matrix3Xd& x) { return 0.5 * (x.rowwise().minCoeff() + x.rowwise().maxCoeff()); }

std::vector<int> SharedFrames(const TexturedPerson& person, const KnownSurface& truth, int every) {
  std::vector<int> shared, thinned;
  for (const int frame : truth.frames()) {
    if (person.person.seen.count(frame)) shared.push_back(frame);
  }
  for (size_t i = 0; i < shared.size(); i += static_cast<size_t>(every)) thinned.push_back(shared[i]);
  return thinned;
}

/// Index of the mesh that has the body's vertices and faces; -1: none.
int SameTopology(const BodyTemplate& body, const KnownSurface& truth) {
  for (size_t m = 0; m < truth.meshes().size(); ++m) {
    const KnownSurface::Mesh& mesh = truth.meshes()[m];
    if (mesh.rest.cols() == body.vertices.cols() && mesh.faces.cols() == body.faces.cols() && mesh.faces == body.faces)
      return static_cast<int>(m);
  }
  return -1;
}

/// Mean distance after rigid alignment, over the vertices that are finite.
std::optional<double> RestDistance(const Eigen::Matrix3Xd& unposed, const Eigen::Matrix3Xd& rest) {
  Eigen::Matrix3Xd a(3, unposed.cols()), b(3, unposed.cols());
  Eigen::Index count = 0;
  for (Eigen::Index v = 0; v < unposed.cols(); ++v) {
    if (!unposed.col(v).allFinite()) continue;
    a.col(count) = rest.col(v), b.col(count++) = unposed.col(v);
  }
  a.conservativeResize(Eigen::NoChange, count), b.conservativeResize(Eigen::NoChange, count);
  const geometry::Alignment alignment = geometry::AlignPoints(a, b);
  if (alignment.status != Status::kOk) return {};
  const Eigen::Matrix3Xd aligned =
      (alignment.b_from_a.rotation.toRotationMatrix() * a).colwise() + alignment.b_from_a.translation;
  return (aligned - b).colwise().norm().mean();
}

class Scorer {
 public:
  Scorer(const TexturedPerson& person, const KnownSurface& truth, const RunContext& run)
      : person_(person), truth_(truth), threads_(ResolveThreads(run.num_threads)), same_(SameTopology(Body(), truth)) {}

  const BodyTemplate& Body() const { return person_.person.body; }

  Surface Posed(int frame) const {
    const BodyPose pose = ToBodyPose(Body(), person_.person.seen.at(frame));
    return {SkinVertices(Body(), pose).cast<double>(), Body().faces};
  }

  WorldAxes Nearer(int frame) const {
    const Eigen::Vector3d body = Middle(Posed(frame).vertices);
    const Eigen::Matrix3Xd truth = truth_.Outer(truth_.Vertices(frame)).vertices;
    return (Middle(FromYDown(truth)) - body).norm() < (Middle(truth) - body).norm() ? WorldAxes::kYDown : WorldAxes::kZUp;
  }

  BodyScore Score(int frame, WorldAxes axes) const {
    BodyScore score;
    score.frame = frame;
    score.fitted = std::count(person_.frames.begin(), person_.frames.end(), frame) > 0;
    const Meshes known = truth_.Vertices(frame);
    Meshes in_world = known;
    if (axes == WorldAxes::kYDown) std::transform(known.begin(), known.end(), in_world.begin(), FromYDown);
    const Surface posed = Posed(frame);
    score.surface =
        CompareSurfaces(SeenFromOutside(posed, threads_), SeenFromOutside(truth_.Outer(in_world), threads_), threads_);
    if (same_ < 0) return score;
    const KnownSurface::Mesh& mesh = truth_.meshes()[same_];
    score.vertices = CompareVertices(Chosen(posed.vertices, mesh.bare), Chosen(in_world[same_], mesh.bare));
    const auto unposed = truth_.Unposed(mesh, known[same_], frame);
    if (unposed)
      score.canonical_m = RestDistance(Chosen(*unposed, mesh.bare), Chosen(Body().vertices.cast<double>(), mesh.bare));
    return score;
  }

  std::string mesh() const { return same_ < 0 ? "" : truth_.meshes()[same_].name; }

 private:
  const TexturedPerson& person_;
  const KnownSurface& truth_;
  const int threads_, same_;
};

std::optional<double> SigmaZ(const TexturedPerson& person, const std::vector<BodyScore>& frames) {
  double square_m2 = 0;
  int count = 0;
  for (const BodyScore& score : frames) {
    if (score.surface.status == Status::kOk) square_m2 += std::pow(score.surface.vertex_rms_m, 2), ++count;
  }
  if (count == 0 || person.offset_sigma_m.size() == 0) return {};
  return std::sqrt(square_m2 / count) /
         std::sqrt(person.offset_sigma_m.squaredNorm() / static_cast<double>(person.offset_sigma_m.size()));
}

std::vector<double> Whitened(const TexturedPerson& person, const std::vector<BodyScore>& frames) {
  std::vector<double> squared;
  for (const BodyScore& score : frames) {
    if (!score.fitted || score.surface.status != Status::kOk) continue;
    for (Eigen::Index v = 0; v < person.offset_sigma_m.size(); ++v) {
      const double distance = score.surface.vertex_m[static_cast<size_t>(v)];
      if (std::isfinite(distance)) squared.push_back(std::pow(distance / person.offset_sigma_m[v], 2));
    }
  }
  return squared;
}

}  // namespace

std::string_view ToString(WorldAxes axes) { return WordOf(kAxes, axes); }

void FromString(const std::string& text, WorldAxes* axes) {
  *axes = KnownChoice(kAxes, text, "option 'axes': expected auto, z-up or y-down, not '" + text + "'");
}

BodyScores ScoreBody(const TexturedPerson& person, const KnownSurface& truth, const BodyScoreOptions& options,
                     const RunContext& run) {
  if (options.every < 1) throw UsageError("option 'every': expected 1 or more");
  const Scorer scorer(person, truth, run);
  const std::vector<int> frames = SharedFrames(person, truth, options.every);
  BodyScores scores;
  scores.mesh = scorer.mesh(), scores.axes = options.axes;
  if (frames.empty()) return scores;
  if (options.axes == WorldAxes::kAuto) scores.axes = scorer.Nearer(frames.front());
  ProgressStage stage(run, "surfaces", static_cast<int64_t>(frames.size()));
  for (const int frame : frames) {
    scores.frames.push_back(scorer.Score(frame, scores.axes));
    stage.Advance();
  }
  scores.sigma_z = SigmaZ(person, scores.frames);
  scores.whitened = Whitened(person, scores.frames);
  return scores;
}

}  // namespace mvstudio::body
