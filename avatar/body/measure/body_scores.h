#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "avatar/body/files/textured_person.h"
#include "avatar/body/measure/known_surface.h"
#include "avatar/body/measure/surface_error.h"
#include "core/fields.h"
#include "core/progress.h"

/// A fitted body beside the true surface of its take.
namespace mvstudio::body {

/// Axes of the truth's world: z up as ours, or y down as Panoptic's, (x, y, z) -> (x, z, -y).
enum class WorldAxes { kAuto, kZUp, kYDown };               ///< kAuto: those of which the first frame lies nearer to the body
std::string_view ToString(WorldAxes axes);                  ///< "auto", "z-up", "y-down"
void FromString(const std::string& text, WorldAxes* axes);  ///< throws UsageError

struct BodyScoreOptions {
  int every = 1;  ///< every n-th frame that both know
  WorldAxes axes = WorldAxes::kAuto;
};

template <class Visitor>
void VisitFields(Visitor&& visit, BodyScoreOptions& o) {
  visit("every", o.every, "score every n-th frame that body and truth share");
  visit("axes", o.axes, "the truth's world: z-up, y-down, or auto: whichever lies nearer to the body");
}

/// One frame.
struct BodyScore {
  int frame = 0;
  bool fitted = false;                  ///< its images took part in the fit; else the body was only posed
  SurfaceError surface;                 ///< the posed body against the truth, of both what can be seen from outside
  std::optional<VertexError> vertices;  ///< where a mesh of the truth has the body's topology; covered vertices are left out
  /// Mean distance of those vertices at rest: the truth's with its bones taken out, the body's as it is; after the rigid motion
  /// that brings them closest. Not known without bones, and where they fold vertices flat (those are left out).
  std::optional<double> canonical_m;
};

struct BodyScores {
  std::string mesh;  ///< of the truth, with the body's topology; empty: none has it
  WorldAxes axes = WorldAxes::kZUp;
  std::vector<BodyScore> frames;  ///< empty when body and truth share none
  /// Squared distances of vertices that are seen from outside, in frames of the fit, over the squared deviations that it gave.
  std::vector<double> whitened;
  std::optional<double> sigma_z;  ///< rms distance of vertices from the truth over rms of the deviations that the fit gave
};

BodyScores ScoreBody(const TexturedPerson& person, const KnownSurface& truth, const BodyScoreOptions& options,
                     const RunContext& run);

}  // namespace mvstudio::body
