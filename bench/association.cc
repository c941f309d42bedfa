#include <cstdio>
#include <cstdlib>

#include "core/stopwatch.h"
#include "tests/triangulate/people.h"
#include "triangulate/people/sides.h"

/// Who is who across views: how often pairs of detections are put together rightly, on synthetic people, and the time a frame.
/// bench_association [REPEATS]
namespace mvstudio::triangulate {
namespace {

struct Scene {
  const char* name;
  int num_cameras, num_people;
  double pair_distance_m;  // 0: anywhere, at least half a metre apart; else in pairs so far apart
  bool is_flat;            // cameras at one height, people of one stature: wrong pairs agree along epipolar lines
  DetectorOptions detector;
};

DetectorOptions Poor() {
  DetectorOptions poor;
  poor.noise_px = 6, poor.missing_people = 0.25, poor.false_people = 0.5, poor.outlier_joints = 0.1;
  return poor;
}

geometry::Rig RigOf(const Scene& scene) {
  if (!scene.is_flat) return MakeRing(scene.num_cameras, 5, {0, 0, 1});
  geometry::Rig rig;
  for (int i = 0; i < scene.num_cameras; ++i) {
    const double angle = 2 * kPi * i / scene.num_cameras;
    rig.cameras.push_back(LookAt("cam_" + std::to_string(i), {5 * std::cos(angle), 5 * std::sin(angle), 1.1}, {0, 0, 1}));
  }
  return rig;
}

std::vector<Walker> PeopleOf(const Scene& scene, Rng* rng) {
  std::vector<Walker> walkers = RandomWalkers(scene.num_people, 1.8, scene.pair_distance_m > 0 ? 1.0 : 0.5, rng);
  for (size_t i = 1; scene.pair_distance_m > 0 && i < walkers.size(); i += 2) {
    const double angle = rng->Uniform(0, 2 * kPi);
    walkers[i].position = walkers[i - 1].position + scene.pair_distance_m * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  }
  for (Walker& walker : walkers) walker.scale = scene.is_flat ? 1 : walker.scale;
  return walkers;
}

void Run(const Scene& scene, int num_frames) {
  const geometry::Rig rig = RigOf(scene);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(7);
  PairScore score;
  double seconds = 0;
  for (int f = 0; f < num_frames; ++f) {
    const SeenPeople seen = Detect(rig, PeopleOf(scene, &rng), f, scene.detector, &rng);
    const Stopwatch watch;
    const auto clusters = AssociateFrame(prepared, seen.frame, {});
    seconds += watch.Seconds();
    Score(seen, clusters, scene.num_people, &score);
  }
  std::printf("%-34s precision %.4f  recall %.4f  whole people %.4f  %7.3f ms/frame\n", scene.name, score.Precision(),
              score.Recall(), score.Perfect(), 1e3 * seconds / num_frames);
}

/// Time to look for swapped sides of one person.
void RunSides(int num_cameras, int num_frames) {
  const geometry::Rig rig = MakeRing(num_cameras, 5, {0, 0, 1});
  Rng rng(3);
  std::vector<DetectedFrame> frames;
  std::vector<std::vector<std::vector<int>>> assignment;
  for (int f = 0; f < num_frames; ++f) {
    frames.push_back(Detect(rig, RandomWalkers(1, 1, 0, &rng), f, {}, &rng).frame);
    std::vector<int>& choice = assignment.emplace_back(1).front();
    for (const auto& people : frames.back().people) choice.push_back(people.empty() ? -1 : 0);
  }
  RunContext one;
  one.num_threads = 1;
  const Stopwatch watch;
  FixSides(Prepare(rig), assignment, {WalkerMirror()}, {}, one, &frames);
  const double seconds = watch.Seconds();
  std::printf("left and right of one person, %d cameras: %.3f ms/frame\n", num_cameras, 1e3 * seconds / num_frames);
}

}  // namespace
}  // namespace mvstudio::triangulate

int main(int argc, char** argv) {
  using namespace mvstudio::triangulate;
  const int repeats = argc > 1 ? std::atoi(argv[1]) : 1;
  const Scene scenes[] = {{"2 people, 4 cameras", 4, 2, 0, false, {}},
                          {"4 people, 4 cameras", 4, 4, 0, false, {}},
                          {"8 people, 8 cameras", 8, 8, 0, false, {}},
                          {"10 people, 8 cameras", 8, 10, 0, false, {}},
                          {"3 people, 2 cameras", 2, 3, 0, false, {}},
                          {"3 people, 3 cameras", 3, 3, 0, false, {}},
                          {"2 people 0.3 m apart, 4 cameras", 4, 2, 0.3, false, {}},
                          {"2 people 0.3 m apart, 8 cameras", 8, 2, 0.3, false, {}},
                          {"4 people in close pairs, 5 cameras", 5, 4, 0.3, false, {}},
                          {"4 people, 5 cameras, poor", 5, 4, 0, false, Poor()},
                          {"6 people, 6 cameras, poor", 6, 6, 0, false, Poor()},
                          {"4 equal people, 4 level cameras", 4, 4, 0, true, {}},
                          {"6 equal people, 6 level, poor", 6, 6, 0, true, Poor()}};
  for (const Scene& scene : scenes) Run(scene, 20 * repeats);
  for (const int num_cameras : {4, 8, 20}) RunSides(num_cameras, 20 * repeats);
}
