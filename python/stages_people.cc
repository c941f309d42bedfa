#include "core/choice/option_style.h"
#include "core/disk/replace.h"
#include "python/stage.h"
#include "stages/markers/describe.h"
#include "stages/sync/describe.h"
#include "stages/triangulate/describe.h"
#include "stages/triangulate/run.h"

namespace mvstudio::python {
namespace {

using Given = std::set<std::string>;

template <class Visitor, class Options>
void VisitPlaces(Visitor& visit, Options& o) {
  visit("points", o.points.path, "folder of triangulate, its points.csv or pose3d.json, or a file of markers");
  VisitFields(visit, o.points);
  VisitStyled(visit, OptionStyle::kPlace, "out", o.out, "what is written: a folder, of convert a file too");
}

template <class Visitor>
void VisitSmoothing(Visitor& visit, stages::MarkerOptions& o) {
  visit("frame-rate", o.rate_hz, "frames a second, e.g. 60; what the input states unless given");
  visit("filter", o.filter, "as of markers");
  visit("fill", o.fill_frames, "gaps of at most so many frames are filled; 0: none");
}

template <class Visitor>
void VisitConvert(Visitor& visit, stages::MarkerConvertOptions& o) {
  VisitPlaces(visit, o);
  visit("to", o.how.to, "trc, c3d, bvh, csv, wide, npz, sto or pose3d; as the output's name ends unless given");
  visit("frame-rate", o.points.rate_hz, "frames a second, e.g. 60; what the input states unless given");
  visit("to-unit", o.how.unit, "m, cm, mm or in: of the output; the format's custom unless given");
  visit("to-up", o.how.up, "x, y or z: the axis that is up in the output; the format's custom unless given");
  visit("person", o.how.person, "the person that is written; -1: the only one, and into a folder all");
}

template <class Options, class Visit, class Run>
Stage MarkerStage(const StageNames& names, Visit visit, Run run) {
  return MakeStage<Options>(names, visit, [run](Options o, const Given&, const RunContext&) {
    o.overwrite = MayReplace();
    return run(o);
  });
}

void AddMarkers(std::vector<Stage>* all) {
  using stages::MarkersOptions;
  all->push_back(MarkerStage<MarkersOptions>(
      {"markers",
       "markers",
       "3D joints as .trc, .c3d, .bvh, tables of markers, joint angles; filled and filtered.",
       {"points"}},
      [](auto& visit, auto& o) { VisitPlaces(visit, o), VisitFields(visit, o.how); },
      [](const MarkersOptions& o) { return Describe(stages::RunMarkers(o)); }));
  all->push_back(MarkerStage<MarkersOptions>(
      {"markers_angles", "markers angles", "Joint angles of people: a table with deviations, and OpenSim's .mot.", {"points"}},
      [](auto& visit, auto& o) { VisitPlaces(visit, o), VisitSmoothing(visit, o.how); },
      [](MarkersOptions o) {
        o.how.to = "angles";
        return Describe(stages::RunMarkers(o));
      }));
  all->push_back(MarkerStage<MarkersOptions>(
      {"markers_events", "markers events", "Heel strikes and toe offs, proposed.", {"points"}},
      [](auto& visit, auto& o) { VisitPlaces(visit, o), VisitSmoothing(visit, o.how); },
      [](const MarkersOptions& o) { return Describe(stages::RunMarkerEvents(o)); }));
  all->push_back(MarkerStage<stages::MarkerConvertOptions>(
      {"markers_convert", "markers convert", "3D points from one format into another.", {"points"}},
      [](auto& visit, auto& o) { VisitConvert(visit, o); },
      [](const stages::MarkerConvertOptions& o) { return Describe(stages::RunMarkerConvert(o)); }));
}

}  // namespace

void AddPeopleStages(std::vector<Stage>* all) {
  all->push_back(MakeStage<stages::SyncOptions>(
      {"sync", "sync", "Time offsets of the cameras: from people who move in the take, or from time stamps."},
      [](auto& visit, auto& o) { VisitFields(visit, o); },
      [](stages::SyncOptions o, const Given& given, const RunContext& run) {
        o.keep_range = given.count("max-offset-frames") > 0;
        return Describe(stages::RunSync(o, run));
      }));
  all->push_back(MakeStage<stages::TriangulateOptions>(
      {"triangulate", "triangulate", "2D joints of several cameras become 3D joints."},
      [](auto& visit, auto& o) { VisitFields(visit, o); },
      [](stages::TriangulateOptions o, const Given& given, const RunContext& run) {
        o.given = given;
        return Describe(stages::RunTriangulate(o, run));
      }));
  AddMarkers(all);
}

}  // namespace mvstudio::python
