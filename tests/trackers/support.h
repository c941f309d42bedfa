#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "dataset/trackers/tracker_file.h"

namespace mvstudio::dataset {

/// A file that pandas, PyTables or h5py wrote (tests/fuzz/seeds).
inline std::string Sample(const std::string& name) {
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  return std::string(source ? source : ".") + "/tests/fuzz/seeds/" + name;
}

inline void ExpectSame(const TrackedPoints& a, const TrackedPoints& b, double tolerance_px) {
  EXPECT_EQ(a.joints, b.joints);
  EXPECT_EQ(a.individuals, b.individuals);
  ASSERT_EQ(a.track.frames.size(), b.track.frames.size());
  for (const auto& [frame, people] : a.track.frames) {
    ASSERT_EQ(b.track.frames.count(frame), 1u) << frame;
    const std::vector<Person2d>& others = b.track.frames.at(frame);
    ASSERT_EQ(people.size(), others.size()) << "frame " << frame;
    for (size_t p = 0; p < people.size(); ++p) {
      ASSERT_EQ(people[p].keypoints.size(), others[p].keypoints.size());
      for (size_t k = 0; k < people[p].keypoints.size(); ++k) {
        const Keypoint2d &x = people[p].keypoints[k], &y = others[p].keypoints[k];
        EXPECT_NEAR(x.x_px, y.x_px, tolerance_px) << frame << " " << p << " " << k;
        EXPECT_NEAR(x.y_px, y.y_px, tolerance_px);
        EXPECT_NEAR(x.score, y.score, 1e-12);
      }
    }
  }
}

}  // namespace mvstudio::dataset
