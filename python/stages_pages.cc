#include "core/disk/replace.h"
#include "core/error.h"
#include "python/stage.h"
#include "stages/body_mesh/describe.h"
#include "stages/dataset/dataset_report.h"
#include "stages/dataset_verify/run.h"
#include "stages/error_budget/describe.h"
#include "stages/overlay/describe.h"
#include "stages/report/describe.h"
#include "stages/study/study.h"
#include "stages/synth/describe.h"

/// Studios with truth, what is said of datasets, pages and drawings of what was found.
namespace mvstudio::python {
namespace {

using Given = std::set<std::string>;

struct VerifyCall {
  std::string folder;
  stages::DatasetVerifyKept kept;
  dataset::VerifyOptions options;
};

struct InfoCall {
  std::string folder;
};

struct ReportCall {
  stages::PageOptions page;
  stages::StudyArguments study;
};

void AddStudios(std::vector<Stage>* all) {
  all->push_back(MakeStage<stages::SynthSessionOptions>(
      {"synth", "synth", "A synthetic session with ground truth.", {"out"}},
      [](auto& visit, auto& o) { VisitFields(visit, o); },
      [](stages::SynthSessionOptions o, const Given&, const RunContext& run) {
        o.overwrite = MayReplace();
        return Describe(stages::RunSynth(o, run));
      }));
  all->push_back(MakeStage<VerifyCall>(
      {"dataset_verify", "dataset verify", "Everything that is wrong with a dataset folder or a pack.", {"folder"}},
      [](auto& visit, auto& o) {
        visit("folder", o.folder, "folder in Panoptic layout, or a pack (folder of shards, .h5 file)");
        visit("keep", o.kept.folder, "folder that keeps the findings for the report; the dataset itself is only read");
        VisitFields(visit, o.options);
        visit("cache", o.kept.cache, "where checks of cameras are that others made by option 'part': a folder, or off");
        visit("part", o.kept.part, "share=K/N: check every N-th camera, keep that, and write a list alone");
      },
      [](const VerifyCall& o, const Given&, const RunContext& run) {
        stages::CommandResult result = stages::RunDatasetVerify(o.folder, o.options, o.kept, run);
        result.folder = o.kept.folder;
        return result;
      }));
  all->push_back(MakeStage<InfoCall>(
      {"dataset_info", "dataset info", "Describe a session, a dataset folder or a pack.", {"folder"}},
      [](auto& visit, auto& o) {
        visit("folder", o.folder, "session, folder in Panoptic layout, or a pack (folder of shards, .h5 file)");
      },
      [](const InfoCall& o, const Given&, const RunContext&) { return stages::DescribeDataset(o.folder); }));
}

void AddDrawings(std::vector<Stage>* all) {
  all->push_back(MakeStage<stages::ErrorBudgetOptions>(
      {"error_budget", "error-budget", "Which stage an error comes from, and whether the sigmas are true."},
      [](auto& visit, auto& o) { VisitFields(visit, o); },
      [](const auto& o, const Given&, const RunContext& run) { return Describe(stages::RunErrorBudget(o, run)); }));
  all->push_back(MakeStage<stages::OverlayOptions>(
      {"render_overlay",
       "render overlay",
       "Footage with what was found drawn over it, as videos and a contact sheet.",
       {"path", "out"}},
      [](auto& visit, auto& o) {
        visit("path", o.scene.path, "folder of a session, a dataset or a run; or points in 3D (.trc, .c3d)");
        VisitFields(visit, o);
      },
      [](stages::OverlayOptions o, const Given&, const RunContext& run) {
        o.overwrite = MayReplace();
        return Describe(stages::RunOverlay(o, run));
      }));
  all->push_back(MakeStage<stages::BodyMeshOptions>(
      {"avatar_mesh", "avatar mesh", "A fitted body as one OBJ mesh a frame, with its texture.", {"body", "out"}},
      [](auto& visit, auto& o) {
        visit("body", o.body, "fitted body: body.npz or the folder with it");
        visit("out", o.out, "new folder for FRAME_00000000.obj, …, body.mtl and body.png");
        visit("frames", o.frames, "80-99 or 1,4,7-9, or all that the body has a pose of");
      },
      [](stages::BodyMeshOptions o, const Given&, const RunContext&) {
        o.overwrite = MayReplace();
        return Describe(stages::RunBodyMesh(o));
      }));
}

template <class Visitor>
void VisitReport(Visitor& visit, ReportCall& o) {
  visit("runs", o.page.runs,
        "folders with the results of other commands; of several, the earliest first, the last is compared with the first");
  VisitFields(visit, o.page);
  visit("study", o.study.sides,
        "instead of a report: a page that asks which of two images is closer to the truth; two runs or folders");
  visit("truth", o.study.truth, "study: folder of the true images; of runs, the truth that they were scored with");
  visit("study-pictures", o.study.images, "study: questions at most, evenly over the images");
  visit("study-tally", o.study.tally, "instead of a report: count these files of answers");
}

stages::CommandResult ReportOrStudy(ReportCall o, const RunContext& run) {
  const int asked = static_cast<int>(!o.page.runs.empty()) + static_cast<int>(!o.study.sides.empty()) +
                    static_cast<int>(!o.study.tally.empty());
  if (asked != 1) throw UsageError("report needs one of option 'runs', option 'study' and option 'study-tally'");
  o.study.title = o.page.page.title, o.study.follow_links = o.page.page.follow_links;
  if (!o.study.sides.empty()) return stages::RunStudy(o.study, o.page.out, run.seed);
  if (!o.study.tally.empty()) return stages::RunStudyTally(o.study);
  if (o.page.page.audience == "client")
    throw UsageError(
        "option 'for' client: only the program leaves paths out: mvstudio.command(\"report\", RUN, for_=\"client\")");
  o.page.page.version = MVSTUDIO_VERSION;
  return Describe(stages::RunPage(o.page));
}

}  // namespace

void AddPageStages(std::vector<Stage>* all) {
  AddStudios(all), AddDrawings(all);
  all->push_back(MakeStage<ReportCall>(
      {"report", "report", "One HTML page, and the same numbers as JSON, of a run or of several side by side.", {}},
      [](auto& visit, auto& o) { VisitReport(visit, o); },
      [](const ReportCall& o, const Given&, const RunContext& run) { return ReportOrStudy(o, run); }));
}

}  // namespace mvstudio::python
