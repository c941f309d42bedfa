#include "core/disk/replace.h"
#include "python/stage.h"
#include "stages/avatar_compare/describe.h"
#include "stages/dataset_build/describe.h"
#include "stages/dataset_export/describe.h"
#include "stages/dataset_import/describe.h"
#include "stages/dataset_pack/describe.h"
#include "stages/dataset_split/describe.h"
#include "stages/scores/describe.h"
#include "stages/session/describe.h"
#include "stages/surface/describe.h"

namespace mvstudio::python {
namespace {

using Given = std::set<std::string>;

void AddSessions(std::vector<Stage>* all) {
  all->push_back(MakeStage<stages::SessionInitOptions>(
      {"session_init", "session init", "Make a session: its folders and a commented mvstudio.toml.", {"folder", "units"}},
      [](auto& visit, auto& o) {
        visit("folder", o.folder, "the session's folder");
        VisitFields(visit, o);
      },
      [](stages::SessionInitOptions o, const Given&, const RunContext&) {
        o.overwrite = MayReplace();
        return Describe(stages::RunSessionInit(o));
      }));
  all->push_back(MakeStage<stages::SessionShowOptions>(
      {"session_show", "session show", "Cameras, takes and footage, and what is wrong with them.", {"folder"}},
      [](auto& visit, auto& o) {
        visit("folder", o.folder, "the session's folder");
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext& run) { return Describe(stages::RunSessionShow(o, run)); }));
  all->push_back(MakeStage<stages::SessionTrustOptions>(
      {"session_trust", "session trust", "Let a session read its footage outside its folder from now on.", {"folder"}},
      [](auto& visit, auto& o) {
        visit("folder", o.folder, "the session's folder");
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext&) { return Describe(stages::RunSessionTrust(o)); }));
  all->push_back(MakeStage<stages::SessionTimelineOptions>(
      {"session_timeline", "session timeline", "Which frame of each camera shows each time step.", {"folder"}},
      [](auto& visit, auto& o) {
        visit("folder", o.folder, "the session's folder");
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext& run) { return Describe(stages::RunSessionTimeline(o, run)); }));
}

void AddBuilders(std::vector<Stage>* all) {
  all->push_back(MakeStage<stages::DatasetBuildOptions>(
      {"dataset_build", "dataset build", "Footage, calibration and 3D joints become a dataset in CMU Panoptic layout."},
      [](auto& visit, auto& o) { VisitFields(visit, o); },
      [](stages::DatasetBuildOptions o, const Given& given, const RunContext& run) {
        o.keep_sequence = given.count("sequence") > 0, o.keep_rate = given.count("frame-rate") > 0;
        o.make_masks = given.count("masks") > 0;
        o.build.overwrite = MayReplace();
        return o.part.empty() ? Describe(stages::RunDatasetBuild(o, run)) : Describe(stages::RunDatasetBuildPart(o, run));
      }));
  all->push_back(MakeStage<stages::DatasetImportOptions>(
      {"dataset_import_panoptic", "dataset import panoptic", "A CMU Panoptic sequence becomes a session.", {"folder", "out"}},
      [](auto& visit, auto& o) {
        visit("folder", o.folder, "folder with calibration_<sequence>.json");
        VisitFields(visit, o);
      },
      [](stages::DatasetImportOptions o, const Given&, const RunContext& run) {
        o.how.overwrite = MayReplace();
        return Describe(stages::RunDatasetImport(o, run));
      }));
  all->push_back(MakeStage<stages::DatasetPackOptions>(
      {"dataset_pack", "dataset pack", "A dataset becomes HDF5 shards with cameras, masks and joints.", {"out"}},
      [](auto& visit, auto& o) {
        visit("dataset", o.dataset, "dataset folder in Panoptic layout");
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext& run) { return Describe(stages::RunDatasetPack(o, run)); }));
  all->push_back(MakeStage<stages::DatasetSplitOptions>(
      {"dataset_split", "dataset split", "Choose cameras and frames for training and test that share neither.", {"folder"}},
      [](auto& visit, auto& o) {
        visit("folder", o.dataset, "dataset folder");
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext& run) { return Describe(stages::RunDatasetSplit(o, run)); }));
  all->push_back(MakeStage<stages::DatasetExportOptions>(
      {"dataset_export", "dataset export", "Write a dataset for the program that is to read it.", {"folder", "to", "out"}},
      [](auto& visit, auto& o) {
        visit("folder", o.dataset, "dataset folder");
        VisitFields(visit, o);
      },
      [](stages::DatasetExportOptions o, const Given&, const RunContext& run) {
        o.layout.overwrite = MayReplace();
        return Describe(stages::RunDatasetExport(o, run));
      }));
}

stages::CommandResult Scores(const stages::ScoresOptions& o, const RunContext& run) {
  stages::RequireTwoSets(o);
  if (o.distance_only || !o.write_statistics.empty())
    throw MissingToolError("distances between sets need libtorch: run `mvstudio metrics`");
  return Describe(stages::RunPairScores(o, run));
}

void AddScores(std::vector<Stage>* all) {
  all->push_back(MakeStage<stages::ScoresOptions>(
      {"metrics", "metrics", "SSIM and PSNR of two folders of images or two images.", {"reference", "other"}},
      [](auto& visit, auto& o) {
        visit("reference", o.reference, "folder of images (or of a folder for each camera), or an image");
        visit("other", o.other, "the same file names");
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext& run) { return Scores(o, run); }));
  all->push_back(MakeStage<stages::AvatarCompareOptions>(
      {"avatar_compare", "avatar compare", "Table of scored runs, methods x splits.", {"runs"}},
      [](auto& visit, auto& o) {
        visit("runs", o.runs, "folders of runs that `avatar eval` has scored; NAME=RUN gives the row's name");
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext&) { return Describe(stages::RunAvatarCompare(o)); }));
  all->push_back(MakeStage<stages::SurfaceOptions>(
      {"avatar_surface", "avatar surface", "Fitted bodies beside the true surface of a rendered person.", {"bodies", "truth"}},
      [](auto& visit, auto& o) {
        visit("bodies", o.bodies, "body.npz files of avatar fit");
        VisitFields(visit, o);
      },
      [](const auto& o, const Given&, const RunContext& run) { return Describe(stages::RunSurface(o, run)); }));
}

}  // namespace

void AddDatasetStages(std::vector<Stage>* all) { AddSessions(all), AddBuilders(all), AddScores(all); }

}  // namespace mvstudio::python
