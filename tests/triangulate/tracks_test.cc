#include "triangulate/people/tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <set>

#include "tests/triangulate/people.h"
#include "triangulate/people/ghosts.h"

namespace mvstudio::triangulate {
namespace {

using People = std::vector<std::optional<Walker>>;  // nothing: not there

/// Frames of people who come and go, with whom each detection shows.
struct Film {
  geometry::Rig rig;
  std::vector<SeenPeople> seen;
  std::vector<DetectedFrame> frames;
};

Film Shoot(int num_cameras, int num_frames, const std::function<People(int)>& people_at, const DetectorOptions& detector,
           uint64_t seed = 1) {
  Film film{MakeRing(num_cameras, 5, {0, 0, 1}), {}, {}};
  Rng rng(seed);
  for (int f = 0; f < num_frames; ++f) {
    std::vector<Walker> walkers;
    std::vector<int> number;
    const People people = people_at(f);
    for (size_t i = 0; i < people.size(); ++i) {
      if (people[i]) walkers.push_back(*people[i]), number.push_back(static_cast<int>(i));
    }
    SeenPeople seen = Detect(film.rig, walkers, f, detector, &rng);
    for (auto& truth : seen.truth) {
      for (int& i : truth) i = i < 0 ? -1 : number[i];
    }
    film.frames.push_back(seen.frame);
    film.seen.push_back(std::move(seen));
  }
  return film;
}

/// For each of the result's persons, which real people its detections show: real person -> number of detections.
std::vector<std::map<int, int>> WhoIsWho(const Film& film, const std::vector<std::vector<std::vector<int>>>& assignment) {
  std::vector<std::map<int, int>> counts(assignment.front().size());
  for (size_t f = 0; f < assignment.size(); ++f) {
    for (size_t p = 0; p < assignment[f].size(); ++p) {
      for (size_t c = 0; c < assignment[f][p].size(); ++c) {
        if (assignment[f][p][c] >= 0) ++counts[p][film.seen[f].truth[c][assignment[f][p][c]]];
      }
    }
  }
  return counts;
}

/// Share of the detections that show the person whom most of them show, the least over persons; these must be different people.
double Purity(const Film& film, const std::vector<std::vector<std::vector<int>>>& assignment) {
  double least = 1;
  std::set<int> who;
  for (const auto& counts : WhoIsWho(film, assignment)) {
    int all = 0, most = 0, main = -1;
    for (const auto& [person, count] : counts) {
      all += count;
      if (count > most) most = count, main = person;
    }
    if (!who.insert(main).second) return 0;
    least = std::min(least, all > 0 ? static_cast<double>(most) / all : 0);
  }
  return least;
}

Walker Walking(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double t, double scale = 1) {
  Walker walker;
  walker.position = from + t * (to - from);
  walker.heading = std::atan2(to.y() - from.y(), to.x() - from.x());
  walker.phase = 12 * t, walker.scale = scale;
  return walker;
}

AssociationOptions Persons(int count) {
  AssociationOptions options;
  options.max_persons = count;
  return options;
}

// Two people walk towards each other and pass at 0.35 m; at 30 frames a second and 1.2 m/s.
TEST(FollowPersons, NoSwapWhereTwoPeopleCross) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const Film film = Shoot(
        4, 75,
        [](int f) {
          return People{Walking({-1.5, 0.175}, {1.5, 0.175}, f / 75.0), Walking({1.5, -0.175}, {-1.5, -0.175}, f / 75.0, 1.06)};
        },
        {}, seed);
    const auto result = AssociatePeople(Prepare(film.rig), film.frames, Persons(2), {});
    ASSERT_EQ(result.assignment.front().size(), 2u);
    EXPECT_GT(Purity(film, result.assignment), 0.985) << seed;
  }
}

// At right angles, with a third who walks beside the first.
TEST(FollowPersons, ThreePathsThatMeet) {
  const Film film =
      Shoot(5, 75,
            [](int f) {
              return People{Walking({-1.5, 0}, {1.5, 0}, f / 75.0), Walking({0.1, -1.5}, {0.1, 1.5}, (f + 12) / 75.0, 0.95),
                            Walking({-1.5, 0.6}, {1.5, 0.6}, f / 75.0, 1.08)};
            },
            {});
  const auto result = AssociatePeople(Prepare(film.rig), film.frames, Persons(3), {});
  EXPECT_GT(Purity(film, result.assignment), 0.98);
}

TEST(FollowPersons, GapsAndReEntryKeepTheNumber) {
  const auto people = [](int f) {
    const bool away = (f >= 30 && f < 45) || (f >= 70 && f < 130);  // 15 frames of a gap; 60, longer than a track lives
    return People{away ? std::nullopt : std::optional(Walking({-1.2, -0.8}, {1.2, -0.8}, f / 200.0)),
                  Walking({1.2, 0.8}, {-1.2, 0.8}, f / 200.0, 1.05)};
  };
  const Film film = Shoot(4, 200, people, {});
  const auto result = AssociatePeople(Prepare(film.rig), film.frames, Persons(4), {});
  ASSERT_EQ(result.assignment.front().size(), 2u);
  EXPECT_GT(Purity(film, result.assignment), 0.99);
}

TEST(FollowPersons, GhostsAreDroppedAndCounted) {
  DetectorOptions detector;
  detector.false_people = 0.9;
  const Film film = Shoot(
      6, 60,
      [](int f) {
        return People{Walking({-1, 0.5}, {1, 0.5}, f / 60.0), Walking({-1, -0.7}, {1, -0.7}, f / 60.0)};
      },
      detector);
  const auto result = AssociatePeople(Prepare(film.rig), film.frames, Persons(20), {});
  EXPECT_EQ(result.assignment.front().size(), 2u);
  EXPECT_GT(result.num_ghosts, 0);
  EXPECT_GE(result.num_ghost_frames, result.num_ghosts);
  EXPECT_GT(Purity(film, result.assignment), 0.97);
}

TEST(FindGhosts, NeedsFewViewsAndLittleElse) {
  const std::vector<TrackSupport> tracks = {{100, 5.5, 6}, {80, 2, 6}, {80, 2, 2}, {2, 2, 3}, {2, 4, 6}, {2, 2.2, 6}};
  EXPECT_THAT(FindGhosts(tracks, 100), ::testing::ElementsAre(false, true, false, true, false, true));
  EXPECT_THAT(FindGhosts(tracks, 5), ::testing::ElementsAre(false, true, false, false, false, true));
  EXPECT_TRUE(FindGhosts({}, 100).empty());
}

TEST(FindGhosts, APersonInATwoCameraRigIsNone) {
  EXPECT_THAT(FindGhosts({{100, 2, 2}, {50, 2, 2}}, 100), ::testing::ElementsAre(false, false));
}

TEST(AssociatePeople, SameForAnyNumberOfThreads) {
  const Film film = Shoot(4, 40,
                          [](int f) {
                            return People{Walking({-1, 0.5}, {1, 0.5}, f / 40.0), Walking({1, -0.7}, {-1, -0.7}, f / 40.0)};
                          },
                          {});
  RunContext one, four;
  one.num_threads = 1, four.num_threads = 4;
  const PreparedRig rig = Prepare(film.rig);
  EXPECT_EQ(AssociatePeople(rig, film.frames, Persons(2), one).assignment,
            AssociatePeople(rig, film.frames, Persons(2), four).assignment);
}

TEST(AssociatePeople, NothingAndNobody) {
  const PreparedRig rig = Prepare(MakeRing(3));
  EXPECT_TRUE(AssociatePeople(rig, {}, {}, {}).assignment.empty());
  const auto result = AssociatePeople(rig, {{0, {{}, {}, {}}}, {5, {{}, {}, {}}}}, Persons(3), {});
  ASSERT_EQ(result.assignment.size(), 2u);
  EXPECT_EQ(result.assignment[1], (std::vector<std::vector<int>>{{-1, -1, -1}}));
}

}  // namespace
}  // namespace mvstudio::triangulate
