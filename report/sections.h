#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "report/page/html.h"
#include "report/page/value.h"
#include "report/report.h"
#include "report/run_data.h"
#include "report/scene/scene.h"
#include "report/svg/rig_view.h"

/// The parts of the page. Each reads the run, returns its HTML, and adds the same numbers to `json` and unusable files to
/// `warnings`.
namespace mvstudio::report {

struct SectionContext {
  const RunData& data;
  const ReportOptions& options;
  Value json = Value::Object();
  std::vector<Notice> warnings;
  int64_t image_bytes = 0;  ///< embedded so far
  std::string script;       ///< that the embedded parts need
  std::string worst_step;   ///< HTML: the take's worst time steps, as the studio in 3D found them
};

/// Adds a script to those that the page needs, once.
void NeedScript(SectionContext* context, std::string_view script);

bool ForClient(const ReportOptions& options);

/// Videos of the avatar, else some of its rendered images, and for clients the player of Gaussians; without a body when there
/// are none.
Section PreviewSection(SectionContext* context);
/// Cameras, boards and people in the page's viewer; without a body when there are none.
Section StudioSection(SectionContext* context);
/// Links to the time steps of the largest residuals and of most joints without a position, with the worst joint and the
/// reasons: at most `most` of each as HTML; empty without any.
struct WorstTimeSteps {
  std::string residuals, missing;
};
WorstTimeSteps FindWorstTimeSteps(const ScenePeople& people, const TableFile& table, size_t most);
Section CalibrationSection(SectionContext* context);
Section TriangulationSection(SectionContext* context);
/// Sessions, time offsets, keypoints, masks; without a body when none of them was run.
Section FootageSection(SectionContext* context);
Section DatasetSection(SectionContext* context);
Section AvatarSection(SectionContext* context);
/// Images of cameras and frames that were held out, worst first; without a body when there are none.
Section HeldOutSection(SectionContext* context);
Section TruthSection(SectionContext* context);
Section ProvenanceSection(SectionContext* context);
/// Written last, shown first: it also shows the warnings of the other sections.
Section VerdictSection(SectionContext* context);
/// A card for each result; `for_studio`: with its folder where there are several, and its errors.
std::string StageCards(const RunData& data, bool for_studio);

/// Worst of the stages' verdicts; an unreadable file is a warning.
Verdict OverallVerdict(const RunData& data);
/// "Nothing failed; 3 of 8 results have warnings. First, calibrate: …"; the last part only `with_reason`.
std::string VerdictSentence(const RunData& data, bool with_reason);
/// A line for each stage with its worst camera and frame, and one for the take's time steps; links where the studio in 3D has
/// them.
std::string WorstList(const SectionContext& context);
/// Failures before warnings, causes before what follows from them; one line a code with its cameras.
std::string WhatToFix(const SectionContext& context);

// Helpers shared by the sections.

/// All numbers, texts and flags of an object as a two-column table, nested objects with dotted names; arrays are left out.
/// Empty string when there are none.
std::string NumbersTable(const std::string& caption, const Value& object);
/// An array of objects as a table: a column for each key whose values are numbers, texts, flags or short arrays of numbers.
/// Keys in `skip` are left out.
std::string ObjectsTable(const std::string& caption, const Value& array, const std::vector<std::string>& skip = {});
/// The same folded, with `title` as its summary; empty without rows.
std::string FoldedTable(const std::string& title, const Value& array);
/// "avatar eval" with its verdict above the stage's content; with its folder where the run has several results of the command.
std::string StageHeading(const RunData& data, const Stage& stage);
/// Brief note for a section without data.
void SetNotRun(Section* section, const std::string& what, const std::string& command);

/// The bytes of an output that may be embedded, where `is_right` takes them; else an empty string and a warning, that it is
/// `what_is_wrong` for one.
std::string ReadOutput(SectionContext* context, const Stage& stage, const Value& output,
                       const std::function<bool(std::string_view)>& is_right, const std::string& what_is_wrong);

/// The image of an output inside the page, or an empty string and a warning. `legend`: names above equal parts of a strip;
/// `compared`: with a slider between the first two of them.
std::string EmbedOutput(SectionContext* context, const Stage& stage, const Value& output, const std::string& caption,
                        const std::vector<std::string>& legend = {}, bool compared = false);

/// Outputs of one role and how they are shown.
struct ImageRole {
  std::string name, title;
  std::vector<std::string> legend;
  bool compared = false;
  std::string caption = {};  ///< of images of no camera; empty: the words of their names
};
/// Those images of a result, the worst by SSIM first, with camera, frame and scores as captions; empty without.
std::string ImagesOf(SectionContext* context, const Stage& stage, const ImageRole& role);
/// RUN/eval/KIND/NAME of a scored run ("render", "truth") as an output; null where the run does not hold it.
Value ImageOfEval(const SectionContext& context, const Stage& stage, const char* kind, const std::string& name);
/// "cam_01.sheet.png" -> "cam 01"
std::string WordsOf(const std::string& file_name);

/// Gaussians in motion inside the page, or an empty string and a warning.
std::string EmbedPlayer(SectionContext* context, const Stage& stage, const Value& output);

/// Parts of a calibration's metrics: the compared lenses and maps over the images; pairs of cameras that saw a board at once;
/// what to film next. Empty without.
std::string CalibrationMaps(const Value& metrics);
std::string Covisibility(const Value& metrics);
std::string CaptureAdvice(const Value& hints);

/// Figures of every camera under a heading; of more than four cameras folded.
std::string CameraFigures(const std::string& heading, const std::string& text, const std::vector<std::string>& figures,
                          size_t num_cameras, const char* css_class = "grid");

/// Boards with their corners and residuals, on the images that the calibration kept; empty without.
std::string BoardViews(SectionContext* context, const Stage& stage);
/// Joints reprojected over an image of each camera, beside its keypoints; empty without.
std::string TakeOverlays(SectionContext* context, const Stage& stage);

/// Scored runs of one protocol in a table and over the same held-out images; empty with fewer than two.
std::string MethodsSideBySide(SectionContext* context);

/// What the fits of bodies found, with their surfaces; empty when none was run.
std::string FittedBodies(SectionContext* context);

/// Drawings of the rig of a calibration file with the people of `points` (may be null) between the cameras; empty without any
/// pose. `skeleton`: the definition in their pose3d.json, or null: then joints are connected as people's.
std::string RigFigures(const Value& calibration, const CsvFile* points, const Value& skeleton);
/// A camera of a calibration file for drawing; its pose is NaN where the file has none.
ViewCamera ReadViewCamera(const Value& camera);
/// Two joints that are drawn as connected; `colour` as in ViewBone.
struct NamedBone {
  std::string from, to, colour;
};
/// The bones of a skeleton's definition; of people, and without one, those by OpenPose's names.
std::vector<NamedBone> NamedBones(const Value& skeleton);
/// What the pose3d.json beside the points says of their skeleton.
Value SkeletonOf(const RunData& data, const CsvFile& points);
/// name, model, size_px, focal_px (of fx and fy, as `calibrate` gives it), focal_sigma_px (null when unknown),
/// center_in_world_m of each camera of a calibration file.
Value CalibrationSummary(const Value& calibration);

}  // namespace mvstudio::report
