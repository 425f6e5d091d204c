// Every number of the step that could have been another, with its unit and its reason.
#pragma once

#include <cstddef>
#include <cstdint>

namespace soda::physics {

// ---- contact finding
constexpr double kContactMargin = 0.01;  // m; a body's reach box is wider than the body by this on each side
// m; two bodies closer than this plus what they can approach within the step get contact points before they touch, so
// that nothing tunnels and resting contacts do not flicker.
constexpr double kSpeculativeDistance = 0.02;
constexpr double kMatchDistance = 0.02;  // m; a point found this near to an old one takes over its impulse

// ---- contact recycling: old anchors are kept while the pair has moved less than this since they were detected. Frozen
// anchors are what keeps tall stacks from creeping, and save most detections in resting scenes.
constexpr double kRecycleDistance = 0.05;    // m, relative translation, at most
constexpr double kRecycleExtentShare = 0.2;  // and at most this share of the smaller half extent of the two
constexpr double kRecycleHalfSine = 0.03489949670250097;  // sin(2 deg): and neither body has turned by more than 4 deg
// m; contacts of one or two points last only while no corner has moved this far: a quarter of the speculative distance,
// beyond which other corners were not looked at.
constexpr double kRecycleCornerDistance = 0.005;

// ---- soft contacts (Catto, "Solver2D", 2024: soft constraints with sub-steps)
constexpr double kContactHertzPerSubstepRate = 0.125;  // contact frequency as a share of the sub-step rate
constexpr double kContactHertzCap = 1000;              // Hz
constexpr double kContactDampingRatio = 10;
constexpr double kStaticHertzFactor = 2;      // contacts with static bodies are stiffer ...
constexpr double kStaticDampingFactor = 0.5;  // ... and less damped
// Springs give under a load. They give less where what a contact's points carried in the last step, on average, need
// not be asked of them: at rest only the other half. (All of it lets towers sway: nothing holds the whole contact then.
// Each point's own makes stacks bend: nothing rights what tilts.) Only where an island has chosen to be stiffer than
// the least: in shallow piles few bodies rock on each other, which what they carried before keeps up.
constexpr double kCarriedShare = 0.5;
constexpr double kTurnedFar = 0.2;           // rad; from there on it is not certain what still overlaps
constexpr double kPushOutSpeed = 3;          // m/s, limit for removing penetration
constexpr double kTouching = 0.005;          // m; of a new contact, points this near share its friction alike
constexpr double kFaintImpulse = 1e-100;     // N s; contacts that carried less are as new ones
constexpr double kMovingSpeed = 0.01;        // m/s; faster against each other, angular momentum is kept to the last
constexpr double kOwedTurn = 0.05;           // rad per step, by which paying back may always turn a body
constexpr double kOwedShare = 0.1;           // of two bodies' energy, that paying angular momentum back may cost
constexpr double kRestitutionThreshold = 1;  // m/s; slower approaches do not bounce
constexpr double kImpactReach = 1.001;  // of what is covered in a sub-step: whoever just touches at its end strikes
constexpr int kImpactIterations = 16;   // over the points of one manifold
constexpr int kMostImpactRounds = 64;   // over an island, in one sub-step; what strikes later is stopped

// ---- how many sub-steps an island gets, where its scene does not say
constexpr std::uint32_t kLeastSubstepLevel = 1;  // 2 sub-steps ...
constexpr std::uint32_t kMostSubstepLevel = 5;   // ... to 32
constexpr double kSagShare =
    0.1;  // of a body's smallest half extent, by which the contact that carries all above gives
constexpr double kDepthRate = 60;  // 1/s; sub-steps per second and root of the contacts between a body and the ground
constexpr double kSofterBelow = 0.4;  // contacts get softer again where less than this share of the sub-steps would do
constexpr double kHeap = 8;           // bodies per contact between the lowest and the highest: a heap, no stack;
constexpr double kStillHeap = 4;      // it is one until there are less
constexpr std::uint32_t kMostHeapStiffness = 3;  // for 8 sub-steps: beyond, loads are uneven
constexpr double kTurnPerSubstep = 0.25;         // rad
constexpr double kSagitta = 1e-4;                // m; a body on a joint leaves its circle by this much in a sub-step
constexpr double kMostSubstepsForTravel = 8;

// ---- joints: stiffer than contacts, since both signs of an impulse are allowed
constexpr double kJointHertzPerSubstepRate = 0.25;
constexpr double kDirectHertzPerSubstepRate = 0.5;  // of joints that are solved as a whole; iterated ones would explode
constexpr double kJointDampingRatio = 2;
// Operations; joints whose direct solution takes more than both are iterated. A chain takes about 40 per row.
constexpr std::size_t kMostDirectWork = 200'000, kMostDirectWorkPerRow = 1000;
constexpr double kPullTogetherSpeed =
    3;  // m/s, of all bodies of a cluster: as fast as its joints may pull them together

// ---- integration
constexpr double kGyroscopicAngle = 1e-3;  // rad per sub-step; slower spinning is taken as free of gyroscopic torque
constexpr int kMidpointIterations = 4;     // each gains a factor of about (angle per sub-step x anisotropy)

// ---- sleeping
constexpr double kSleepSpeed = 0.05;  // m/s, of the centre of mass, and of the fastest point about it
constexpr double kSleepTime = 0.5;    // s below that speed until an island may sleep

// ---- canonical order of constraints: four grids of blocks, each shifted against the one before
constexpr double kBlockDiameters = 8;  // edge of a block in largest ordinary diameters
constexpr int kBlockGrids = 4;

}  // namespace soda::physics
