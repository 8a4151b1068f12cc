#include "common/base/parallel.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <atomic>
#include <limits>
#include <new>
#include <stdexcept>
#include <vector>

namespace glint {
namespace {

TEST(ParallelForTest, VisitsEveryIndexOnce) {
  for (const size_t count : {0u, 1u, 2u, 7u, 100u, 1000u}) {
    for (const int threads : {1, 2, 3, 8}) {
      for (const size_t grain : {0u, 1u, 3u, 64u, 5000u}) {
        std::vector<std::atomic<int>> visits(count);
        std::atomic<int> bad_threads{0};
        ParallelFor(count, threads, grain, [&](size_t i, int thread) {
          ++visits[i];
          if (thread < 0 || thread >= threads) ++bad_threads;
        });
        for (size_t i = 0; i < count; ++i) ASSERT_EQ(visits[i], 1) << i << " of " << count;
        EXPECT_EQ(bad_threads, 0) << threads << " threads";
      }
    }
  }
}

TEST(ParallelForTest, AHugeGrainDoesNotOverflow) {
  std::atomic<int> visits{0};
  ParallelFor(10, 4, std::numeric_limits<size_t>::max(), [&](size_t, int) { ++visits; });
  EXPECT_EQ(visits, 10);
}

TEST(ParallelForTest, Nests) {
  std::atomic<int> visits{0};
  ParallelFor(4, 3, 1, [&](size_t, int) { ParallelFor(5, 2, 1, [&](size_t, int) { ++visits; }); });
  EXPECT_EQ(visits, 20);
}

TEST(ParallelForTest, AnExceptionOfAnyThreadReachesTheCaller) {
  for (const int threads : {1, 2, 5}) {
    EXPECT_THROW(ParallelFor(100, threads, 1, [](size_t, int) { throw std::bad_alloc(); }), std::bad_alloc);
    // Of the helpers alone: this thread waits until one of them has failed.
    if (threads == 1) continue;
    std::atomic<bool> failed{false};
    EXPECT_THROW(ParallelFor(100, threads, 1,
                             [&](size_t, int thread) {
                               if (thread > 0) {
                                 failed = true;
                                 throw std::runtime_error("of a helper");
                               }
                               while (!failed) sched_yield();
                             }),
                 std::runtime_error);
  }
}

TEST(ParallelForTest, NothingIsStartedAfterAnException) {
  std::atomic<int> visits{0};
  EXPECT_THROW(ParallelFor(1000, 1, 1,
                           [&](size_t i, int) {
                             ++visits;
                             if (i == 3) throw std::bad_alloc();
                           }),
               std::bad_alloc);
  EXPECT_EQ(visits, 4);
}

TEST(ResolveThreadCountTest, IsTheRequestOrTheCoresOfThisProcess) {
  EXPECT_EQ(ResolveThreadCount(5), 5);
  EXPECT_GE(ResolveThreadCount(0), 1);
  EXPECT_GE(ResolveThreadCount(-3), 1);

  cpu_set_t before;
  ASSERT_EQ(sched_getaffinity(0, sizeof before, &before), 0);
  int core = 0;
  while (!CPU_ISSET(core, &before)) ++core;
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(core, &one);
  ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
  EXPECT_EQ(ResolveThreadCount(0), 1);
  ASSERT_EQ(sched_setaffinity(0, sizeof before, &before), 0);
}

}  // namespace
}  // namespace glint
