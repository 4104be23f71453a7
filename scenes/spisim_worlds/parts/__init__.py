"""What families share: shapes, ground, plants, houses, vehicles, people and things on sites."""
